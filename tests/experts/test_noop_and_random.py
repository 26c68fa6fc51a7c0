"""The two policies that need neither skill nor images."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.policies.contract import Episode, Query, query_seed
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION

EPISODE = Episode("libero_spatial", 0, "do it", 195, 220)


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def test_noop_holds_still_and_sees_nothing(world: TinyWorld) -> None:
    policy = load_policy("noop")
    policy.reset(EPISODE)
    assert policy.spec.cameras == ()
    actions = policy.predict(world.observe((), 64), Query(0, 0, "", 1))
    assert actions.tolist() == [list(NOOP_ACTION)] * policy.spec.horizon


def test_random_draws_from_the_querys_seed_alone(world: TinyWorld) -> None:
    policy = load_policy("random", horizon=30, query_interval=30)
    assert policy.spec.cameras == CAMERAS
    queries = [Query(index, 30 * index, "", query_seed(195, index)) for index in range(4)]
    chunks: list[dict[int, bytes]] = []
    for order in (queries, queries[::-1]):
        np.random.seed(len(chunks))  # noqa: NPY002  # the global generator, which must not matter
        policy.reset(EPISODE)
        chunks.append({query.index: policy.predict({}, query).tobytes() for query in order})
    assert chunks[0] == chunks[1]
    assert len(set(chunks[0].values())) == 4
    actions = np.frombuffer(chunks[0][0]).reshape(30, 7)
    assert np.abs(actions).max() <= 1.0
    assert actions.std() == pytest.approx(1 / np.sqrt(3), abs=0.1)
