"""An arm as an environment for other loops."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.errors import ActionError, ProtocolError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.environment import ArmEnv
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import Approaching, Solvable, make_case

BLIND = PolicySpec("outside", horizon=5, query_interval=4, cameras=())


@pytest.fixture
def worlds() -> Iterator[list[TinyWorld]]:
    worlds = [TinyWorld() for _ in range(3)]
    yield worlds
    for world in worlds:
        world.close()


def stepped(env: ArmEnv, actions: NDArray[np.float64]) -> tuple[list[Any], list[str]]:
    """Events and proofs of an episode in which these actions are executed."""
    _, info = env.reset(seed=3)
    events, proofs = list(info["events"]), [info["proof"]]
    for number, action in enumerate(actions):
        _, reward, terminated, truncated, info = env.step(action)
        events += info["events"]
        proofs.append(info["proof"])
        assert info["step"] == number + 1
        assert (reward, terminated) == (0.0, False)
        assert truncated == (number == len(actions) - 1)
    return events, proofs


def test_an_environment_is_the_arm_that_the_runner_plays(worlds: list[TinyWorld]) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=2, horizon=5, interval=4)
    pair = measure_pair(case, worlds[0], policy)
    record = pair.record
    assert pair.dynamic is not None
    base_arm, dynamic_arm = arms_of(case)
    base = ArmEnv(case, worlds[1], base_arm, BLIND)
    dynamic = ArmEnv(case, worlds[2], dynamic_arm, BLIND)
    with pytest.raises(ProtocolError, match=r"reset\(\)"):
        base.step(np.zeros(7))
    for env, rollout in ((base, pair.base), (dynamic, pair.dynamic)):
        events, proofs = stepped(env, rollout.actions)
        assert env.result.proof == proofs[-1] == rollout.proof
        assert env.result.probes == rollout.probes
        assert [event["step"] for event in events] == [firing.step for firing in rollout.firings]
        if events:
            assert events[0]["evidence"] == record.evidence
            assert events[0]["prefix_proof"] == record.prefix_digest
        with pytest.raises(ProtocolError, match=r"reset\(\)"):
            env.step(np.zeros(7))


def test_an_environment_shows_what_was_asked_for_and_ends_with_success() -> None:
    world = Solvable(lambda world: world.steps >= 13)
    env = ArmEnv(make_case(), world, spec=PolicySpec("outside", cameras=("agentview",), image_size=16))
    observation, info = env.reset()
    assert observation["agentview_image"].shape == (16, 16, 3)
    assert info["instruction"] == world.language
    ends = [env.step(np.zeros(7))[1:4] for _ in range(3)]
    assert ends == [(0.0, False, False), (0.0, False, False), (1.0, True, False)]
    env.reset()
    with pytest.raises(ActionError, match="shape"):
        env.step(np.zeros(6))
    env.close()
    world.close()
