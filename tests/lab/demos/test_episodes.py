from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.lab.demos.episodes import Planned, planned, record
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.worlds.robot import CAMERAS
from tests.pairing.actors import ShortCase, Solvable, make_case, policy_steps


class Reach:
    """Moves to where the box begins; what it asks for is not to be drawn."""

    def __init__(self) -> None:
        self.spec = PolicySpec("reach", 10, 5, privileged=True, image_size=64)

    def reset(self, episode: Any) -> None:
        pass

    def predict(self, observation: Any, query: Any) -> Any:
        assert "agentview_image" not in observation
        move = np.clip((np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05, -1, 1)
        return np.tile([*move, 0, 0, 0, 1], (10, 1))


@pytest.fixture
def world() -> Iterator[Solvable]:
    world = Solvable(lambda world: policy_steps(world) == 12)
    yield world
    world.close()


@pytest.mark.parametrize("arm", ["base", "dynamic"])
def test_what_is_recorded_is_what_the_world_showed_before_each_action(arm: str, world: Solvable) -> None:
    plan = Planned(make_case("target_relocation", distance_m=0.3), arm)
    demo = record(plan, world, Reach(), 16)
    assert demo.success
    assert demo.actions.shape == (12, 7)
    for camera in CAMERAS:
        assert demo.observations[f"{camera}_image"].shape == (12, 16, 16, 3)
    assert demo.observations["robot0_eef_quat"].shape == (12, 4)
    assert (demo.event_step is not None) == (arm == "dynamic")
    # The same actions, from the same beginning, show the same.
    again = record(plan, world, Reach(), 16)
    for key, value in demo.observations.items():
        assert value.tobytes() == again.observations[key].tobytes()


def test_base_and_dynamic_are_the_same_until_the_event_and_show_it_at_once(world: Solvable) -> None:
    case = make_case("target_relocation", distance_m=0.3)
    base, dynamic = (record(Planned(case, arm), world, Reach(), 32) for arm in ("base", "dynamic"))
    step = dynamic.event_step
    assert step is not None
    assert 0 < step < 12
    images = [demo.observations["agentview_image"] for demo in (base, dynamic)]
    assert images[0][:step].tobytes() == images[1][:step].tobytes()
    assert (images[0][step] != images[1][step]).any()


def test_a_disturbed_hand_is_recorded_with_what_the_expert_wanted(world: Solvable) -> None:
    plan = Planned(make_case(), "base")
    plain = record(plan, world, Reach(), 16)
    pushed, again = (record(plan, world, Reach(), 16, disturbed=0.5) for _ in range(2))
    assert plain.executed is None
    assert pushed.executed is not None
    assert again.executed is not None
    assert pushed.executed.tobytes() == again.executed.tobytes()
    aside = np.abs(pushed.executed - pushed.actions).max(axis=1) > 0
    # A push lasts from one query to the next; Q is 5, and 12 steps have 3 queries.
    assert sorted({bool(aside[step]) for step in (0, 5, 10)}) == [False, True]
    assert all(len({*aside[step : step + 5]}) == 1 for step in (0, 5, 10))
    assert (np.abs(pushed.executed) <= 1).all()
    assert (pushed.executed[:, 6] == pushed.actions[:, 6]).all()
    # The expert answers to where the hand is after the push.
    first = int(np.flatnonzero(aside)[0])
    assert (pushed.actions[first] == plain.actions[first]).all()
    hand = pushed.observations["robot0_eef_pos"]
    after = next(step for step in (5, 10) if step > first)
    wanted = np.clip((np.array([0.1, -0.1, 0.5]) - hand[after]) / 0.05, -1, 1)
    assert np.allclose(pushed.actions[after, :3], wanted)
    assert not np.allclose(hand[after], plain.observations["robot0_eef_pos"][after], atol=1e-3)


def test_an_episode_that_does_not_reach_the_goal_is_no_success() -> None:
    class Brief(ShortCase):
        @property
        def budget(self) -> int:
            return 6

    world = Solvable()
    case = make_case()
    brief = Brief(**{field.name: getattr(case, field.name) for field in fields(case)})
    demo = record(Planned(brief, "base"), world, Reach(), 16)
    world.close()
    assert not demo.success
    assert len(demo.actions) == 6


def test_plans_hold_base_and_every_event_that_a_task_can_host() -> None:
    plans = list(planned(["libero_object"], [2], [0, 1], BENCHMARK_EVENTS))
    names = [plan.name for plan in plans]
    assert names[0] == "libero_object-t02-i00-base"
    assert len(set(names)) == len(names) == 18
    assert {plan.case.event.variant for plan in plans if plan.case.event.name == "camera_shift"} == {0, 1}
    assert len(list(planned(["libero_object", "libero_goal"], None, [0], []))) == 20
    with pytest.raises(OptionError, match=r"event='camera'.*camera_shift"):
        list(planned(["libero_object"], [0], [0], ["camera"]))
    with pytest.raises(OptionError, match="task=10 of libero_object"):
        list(planned(["libero_object"], [10], [0], []))
