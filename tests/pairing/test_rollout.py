"""A rollout that is driven from outside."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.errors import ActionError, ProtocolError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import Approaching, make_case


@pytest.fixture
def worlds() -> Iterator[list[TinyWorld]]:
    worlds = [TinyWorld() for _ in range(3)]
    yield worlds
    for world in worlds:
        world.close()


def test_a_rollout_says_which_query_is_next_until_it_is_answered(worlds: list[TinyWorld]) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=2, horizon=5, interval=4)
    rollout = Rollout.start(Stage(case, worlds[0], policy), arms_of(case)[1:])
    with pytest.raises(ProtocolError, match=r"due\(\)"):
        rollout.answer(np.zeros((5, 7)))
    asked = []
    while (query := rollout.due()) is not None:
        assert rollout.due() is query
        asked.append(query.step)
        rollout.answer(policy.predict(rollout.observed(), query))
        with pytest.raises(ProtocolError, match=r"due\(\)"):
            rollout.answer(np.zeros((5, 7)))
    pair = measure_pair(case, worlds[0], policy)
    assert pair.dynamic is not None
    assert rollout.trajectory.proof == pair.dynamic.proof
    assert asked == [query.step for query in pair.dynamic.queries]


def test_an_answer_that_cannot_be_played_names_its_query(worlds: list[TinyWorld]) -> None:
    rollout = Rollout.start(Stage(make_case(), worlds[0], Approaching(horizon=4, interval=2)))
    assert rollout.due() is not None
    with pytest.raises(ActionError, match=r"^query 0 at step 0: .*\b1\b"):
        rollout.answer(np.zeros((1, 7)))
    rollout.answer(np.zeros((2, 7)))
    assert rollout.due() is not None
    assert rollout.trajectory.step == 2
