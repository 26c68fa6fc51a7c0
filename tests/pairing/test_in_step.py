"""Rollouts that others drive: several pairs under one batch, and their own loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.errors import ActionError, AdapterError, ProtocolError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.environment import ArmEnv
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import PairSettings, measure_in_step, measure_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.contract import BatchItem
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import BUDGET, Approaching, Solvable, make_case


class Together(Approaching):
    """Answers several queries together; counts how many each time."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.sizes: list[int] = []

    def predict_batch(self, items: Sequence[BatchItem]) -> list[NDArray[np.float64]]:
        self.sizes.append(len(items))
        assert all(item.episode.max_steps == BUDGET for item in items)
        return [super(Together, self).predict(item.observation, item.query) for item in items]


@pytest.fixture
def worlds() -> Iterator[list[TinyWorld]]:
    worlds = [TinyWorld() for _ in range(3)]
    yield worlds
    for world in worlds:
        world.close()


@pytest.mark.parametrize("mode", ["fork", "replay"])
def test_pairs_in_step_are_those_that_are_played_one_by_one(worlds: list[TinyWorld], mode: Any) -> None:
    cases = [make_case(event) for event in ("target_relocation", "camera_shift", "sensor_noise_onset")]
    policy, settings = Together(wait=3, horizon=6, interval=4, cameras=("agentview",)), PairSettings(mode)
    together = measure_in_step(list(zip(cases, worlds, strict=True)), policy, settings)
    alone = [measure_pair(case, worlds[0], policy, settings) for case in cases]
    assert [pair.record.identity() for pair in together] == [pair.record.identity() for pair in alone]
    assert all(pair.record.triggered for pair in together)
    assert max(policy.sizes) == 3


def test_pairs_that_end_early_leave_the_batch(worlds: list[TinyWorld]) -> None:
    policy = Together(wait=BUDGET, horizon=5, interval=5)
    cases = [make_case(distance_m=9.0), make_case(), make_case()]
    pairs = measure_in_step(list(zip(cases, worlds, strict=True)), policy)
    assert [pair.record.triggered for pair in pairs] == [True, False, False]
    assert policy.sizes == [3] * 10 + [1] * (len(policy.sizes) - 10)


def test_what_cannot_be_asked_together_is_refused(worlds: list[TinyWorld]) -> None:
    case = make_case()
    with pytest.raises(AdapterError, match="cannot answer queries of several episodes together"):
        measure_in_step([(case, worlds[0])], Approaching())
    with pytest.raises(AdapterError, match="have one world"):
        measure_in_step([(case, worlds[0]), (case, worlds[0])], Together())


def test_an_error_of_the_batch_leaves_every_scene_as_it_was_built(worlds: list[TinyWorld]) -> None:
    class Failing(Together):
        def predict_batch(self, items: Any) -> Any:
            worlds[1].model.opt.gravity[2] = -1.0
            raise ValueError("out of memory")

    case = make_case()
    with pytest.raises(AdapterError, match="out of memory"):
        measure_in_step([(case, world) for world in worlds], Failing())
    assert worlds[1].model.opt.gravity[2] == pytest.approx(-9.81)


def test_a_rollout_says_which_query_is_next_until_it_is_answered(worlds: list[TinyWorld]) -> None:
    case, policy = make_case("target_relocation"), Approaching(wait=2, horizon=5, interval=4)
    rollout = Rollout.start(Stage(case, worlds[0], policy), arms_of(case)[1:])
    with pytest.raises(ProtocolError, match="no query is due"):
        rollout.answer(np.zeros((5, 7)))
    asked = []
    while (query := rollout.due()) is not None:
        assert rollout.due() is query
        asked.append(query.step)
        rollout.answer(policy.predict(rollout.observed(), query))
        with pytest.raises(ProtocolError, match="no query is due"):
            rollout.answer(np.zeros((5, 7)))
    pair = measure_pair(case, worlds[0], policy)
    assert pair.dynamic is not None
    assert rollout.trajectory.proof == pair.dynamic.proof
    assert asked == [query.step for query in pair.dynamic.queries]


def test_an_answer_that_cannot_be_played_names_its_query(worlds: list[TinyWorld]) -> None:
    rollout = Rollout.start(Stage(make_case(), worlds[0], Approaching(horizon=4, interval=2)))
    assert rollout.due() is not None
    with pytest.raises(ActionError, match=r"^query 0 at step 0: policy 'approaching' returned 1 action"):
        rollout.answer(np.zeros((1, 7)))
    rollout.answer(np.zeros((2, 7)))
    assert rollout.due() is not None
    assert rollout.trajectory.step == 2


# As an environment.


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
    base = ArmEnv(case, worlds[1], base_arm, cameras=())
    dynamic = ArmEnv(case, worlds[2], dynamic_arm, cameras=())
    with pytest.raises(ProtocolError, match="no episode is running"):
        base.step(np.zeros(7))
    for env, rollout in ((base, pair.base), (dynamic, pair.dynamic)):
        events, proofs = stepped(env, rollout.actions)
        assert env.result.proof == proofs[-1] == rollout.proof
        assert env.result.probes["approach"] == rollout.probes["approach"]
        assert [event["step"] for event in events] == [firing.step for firing in rollout.firings]
        if events:
            assert events[0]["evidence"] == record.evidence
            assert events[0]["prefix_proof"] == record.prefix_digest
        with pytest.raises(ProtocolError, match="no episode is running"):
            env.step(np.zeros(7))


def test_an_environment_shows_what_was_asked_for_and_ends_with_success() -> None:
    world = Solvable(lambda world: world.steps >= 13)
    env = ArmEnv(make_case(), world, cameras=("agentview",), image_size=16)
    observation, info = env.reset()
    assert observation["agentview_image"].shape == (16, 16, 3)
    assert info["instruction"] == world.language
    ends = [env.step(np.zeros(7))[1:4] for _ in range(3)]
    assert ends == [(0.0, False, False), (0.0, False, False), (1.0, True, False)]
    env.reset()
    with pytest.raises(ActionError, match="returned actions of shape"):
        env.step(np.zeros(6))
    env.close()
    world.close()
