"""Diagnosis: policies that are made to fail in one known way, each named right, on embedded scenes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.experts.expert import ExpertPolicy, plan
from pytest_libero_max.experts.motion import follow
from pytest_libero_max.experts.scene_view import owner_of, read_hand
from pytest_libero_max.pairing.record import PROGRAM, PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.report.diagnosis import CAUSES, Diagnosis, diagnose
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import NOOP_ACTION
from tests.short_episodes import shorten_here

Actions = NDArray[np.float64]


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


SLOW = ("sweeps", "puts_it_beside", "puts_it_on_a_closed_drawer")
"""What takes longer than an expert."""


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Time for an expert to succeed, and not much more for what fails."""
    if not request.node.name.endswith(tuple(f"[{name}]" for name in SLOW)):
        shorten_here(monkeypatch, 150)


class Broken(ExpertPolicy):
    """The expert, with its actions altered: a function of the world, the query and the actions."""

    def __init__(self, alter: Callable[[Broken, Query, Actions], Actions], beside_m: float = 0.0) -> None:
        self.spec = replace(ExpertPolicy.spec, cameras=())
        self._alter, self._beside = alter, np.array([beside_m, 0.0, 0.0])

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self.world = self._world
        self.target = owner_of(self.world, self.world.goal[0].subject)
        if not hasattr(self, "start"):  # an episode may begin again in the middle of one
            self.start = self.world.position(self.target)
            self.light = self.world.model.light_diffuse.copy()

    def predict(self, observation: Observation, query: Query) -> Actions:
        hand = read_hand(self._world)
        hand = replace(hand, position=hand.position + self._beside)
        actions, _ = follow(hand, plan(self._world, hand), self.spec.horizon)
        return self._alter(self, query, np.array(actions))

    def towards(self, place: Any) -> Actions:
        way = np.asarray(place) - self.world.end_effector()
        return np.tile([*np.clip(20 * way, -1, 1), 0.0, 0.0, 0.0, -1.0], (self.spec.horizon, 1))

    @property
    def lifted_m(self) -> float:
        held = self.world.fingers_on(self.target) == 2
        return float(self.world.position(self.target)[2] - self.start[2]) if held else 0.0


class Other:
    """A world that tells something else than it is."""

    def __init__(self, world: Any, **told: Any) -> None:
        self._inner, self._told = world, told

    def __getattr__(self, name: str) -> Any:
        return self._told[name] if name in self._told else getattr(self._inner, name)


class Deceived(Broken):
    """The expert in a world of which it is told wrong things."""

    def __init__(self, **told: Callable[[Any], Any]) -> None:
        super().__init__(lambda policy, query, actions: actions)
        self._told = told

    def reset(self, episode: Episode) -> None:
        super().reset(episode)
        self._world: Any = Other(self.world, **{name: tell(self.world) for name, tell in self._told.items()})


def gripper(actions: Actions, command: float) -> Actions:
    actions[:, 6] = command
    return actions


def still(actions: Actions, command: float = -1.0) -> Actions:
    return np.tile([*NOOP_ACTION[:6], command], (len(actions), 1))


def dark(policy: Broken) -> bool:
    return not np.array_equal(policy.world.model.light_diffuse, policy.light)


def plate_is(off_m: float) -> Callable[[Any], Callable[[str], Any]]:
    def tell(world: Any) -> Callable[[str], Any]:
        return lambda name: world.position(name) + np.array([0.0, off_m if name == "plate_1" else 0.0, 0.0])

    return tell


def another(world: Any) -> Any:
    return tuple(replace(fact, subject="akita_black_bowl_2") for fact in world.goal)


SPATIAL, OBJECT, SOUPS = ("libero_spatial", 0), ("libero_object", 4), ("libero_10", 0)
LIGHT, TARGET, GOAL = "illumination_switch", "target_relocation", "receptacle_relocation"


def freezes_in_the_dark(policy: Broken, query: Query, actions: Actions) -> Actions:
    return still(actions) if dark(policy) else actions


def stays_with_it(policy: Broken, query: Query, actions: Actions) -> Actions:
    return still(actions, 1.0) if dark(policy) and policy.lifted_m > 0.03 else actions


def opens_high_up(policy: Broken, query: Query, actions: Actions) -> Actions:
    return gripper(actions, -1.0) if dark(policy) and policy.lifted_m > 0.1 else actions


def never_closes(policy: Broken, query: Query, actions: Actions) -> Actions:
    return gripper(actions, -1.0) if dark(policy) else actions


def slows_down(policy: Broken, query: Query, actions: Actions) -> Actions:
    return actions * [0.01, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0] if dark(policy) else actions


def sweeps(policy: Broken, query: Query, actions: Actions) -> Actions:
    if not dark(policy):
        return actions
    target = policy.world.position(policy.target)
    low = policy.world.end_effector()[2] < target[2] + 0.04
    away = policy.start + np.array([0.0, -0.3, 0.02]) if low else policy.start + np.array([0.0, 0.12, 0.02])
    return policy.towards(away)


def pushes_the_cabinet(policy: Broken, query: Query, actions: Actions) -> Actions:
    cabinet = policy.world.position("wooden_cabinet_1") + np.array([0.0, 0.0, 0.12])
    return policy.towards(cabinet) if dark(policy) else actions


def stops_early(policy: Broken, query: Query, actions: Actions) -> Actions:
    return still(actions) if query.step >= 10 else actions


def plain(policy: Broken, query: Query, actions: Actions) -> Actions:
    return actions


FAILING: dict[str, tuple[str, Any, str, tuple[str, int]]] = {
    "looks_once_target": ("missed_moved_target", "stale_expert", TARGET, SPATIAL),
    "looks_once_target_in_a_floor_scene": ("missed_moved_target", "stale_expert", TARGET, OBJECT),
    "looks_once_goal": ("missed_moved_goal", "stale_expert", GOAL, SPATIAL),
    "freezes": ("froze_after_event", Broken(freezes_in_the_dark), LIGHT, SPATIAL),
    "stays_with_it": ("timed_out_holding", Broken(stays_with_it), LIGHT, SPATIAL),
    "opens_high_up": ("dropped", Broken(opens_high_up), LIGHT, OBJECT),
    "never_closes": ("never_closed", Broken(never_closes), LIGHT, SPATIAL),
    "slows_down": ("timed_out", Broken(slows_down), LIGHT, SPATIAL),
    "sweeps": ("pushed_target", Broken(sweeps), LIGHT, SPATIAL),
    "pushes_the_cabinet": ("blocked_by_obstacle", Broken(pushes_the_cabinet), LIGHT, SPATIAL),
}
IN_BASE: dict[str, tuple[str, Any, tuple[str, int]]] = {
    "noop": ("not_attempted", "noop", SPATIAL),
    "random": ("never_reached", "random", SPATIAL),
    "stops_early": ("froze", Broken(stops_early), SPATIAL),
    "puts_it_beside": ("placed_beside_goal", Deceived(position=plate_is(0.08)), SPATIAL),
    "puts_it_elsewhere": ("placed_elsewhere", Deceived(position=plate_is(-0.28)), SPATIAL),
    "puts_it_on_a_closed_drawer": ("moved_goal", "stale_expert", ("libero_goal", 3)),
    "takes_another": ("wrong_object", Deceived(goal=another), SPATIAL),
    "grasps_beside": ("grasp_missed", Broken(plain, beside_m=0.07), OBJECT),
    "pulls_beside": ("part_not_moved", Broken(plain, beside_m=0.06), ("libero_goal", 0)),
}


def play(policy: Any, event: str, task: tuple[str, int], substrate: EmbeddedSubstrate) -> PairRecord:
    case: Case = make_case(event, *task, variant=1)
    if isinstance(policy, str):
        policy = load_policy(policy)
        policy.spec = replace(policy.spec, cameras=())
    return play_pair(case, substrate.world(case), policy)


def diagnosed(record: PairRecord, arm: str) -> Diagnosis:
    found = diagnose(record, arm)
    assert found is not None
    assert found.cause in CAUSES
    return found


@pytest.mark.parametrize("name", FAILING)
def test_a_regression_is_named_by_the_way_in_which_the_policy_was_broken(
    name: str, substrate: EmbeddedSubstrate
) -> None:
    cause, policy, event, task = FAILING[name]
    record = play(policy, event, task, substrate)
    assert record.base_success
    assert diagnose(record, "base") is None
    found = diagnosed(record, "dynamic")
    assert found.cause == cause, found.sentence


@pytest.mark.parametrize("name", IN_BASE)
def test_a_failure_in_base_is_named_there_and_said_to_be_old_in_dynamic(
    name: str, substrate: EmbeddedSubstrate
) -> None:
    cause, policy, task = IN_BASE[name]
    record = play(policy, "camera_shift", task, substrate)
    found = diagnosed(record, "base")
    assert found.cause == cause, found.sentence
    assert diagnosed(record, "dynamic").cause == "already_failing_in_base"


def test_a_basket_that_is_pushed_after_a_missed_grasp_is_not_the_cause(substrate: EmbeddedSubstrate) -> None:
    record = play(Broken(plain, beside_m=0.07), "camera_shift", OBJECT, substrate)
    base = record.arms["base"]
    assert base.probes is not None
    later = {"moved": ["basket_1"], "moved_step": [200], "moved_m": [0.08]}
    pushed = structs.replace(base, probes={"stages": {**base.probes["stages"], **later}})
    found = diagnosed(structs.replace(record, arms={**record.arms, "base": pushed}), "base")
    assert found.cause == "grasp_missed", found.sentence


def test_the_sentence_of_a_program_tells_what_it_did_and_not_the_event_of_the_case(
    substrate: EmbeddedSubstrate,
) -> None:
    record = play(Broken(never_closes), LIGHT, SPATIAL, substrate)
    assert diagnosed(record, "dynamic").sentence.startswith("Illumination switch ")
    program = structs.replace(record, fingerprints={**record.fingerprints, PROGRAM: "dark 0"})
    assert diagnosed(program, "dynamic").sentence.startswith("Light changed ")
