"""More than two arms: what they share is executed once, and each is what it would be alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st
from msgspec import structs

from pytest_libero_max import strategies
from pytest_libero_max.changes import (
    Change,
    Evidence,
    Factor,
    Nothing,
    SetInstruction,
    SetLighting,
    SetSensorCorruption,
    SetVisualTheme,
    ShiftCamera,
    change_from_dict,
)
from pytest_libero_max.errors import AdapterError, ChangeError, ManifestError
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of
from pytest_libero_max.events.triggers import AtStart, BudgetFraction, Proximity, StepsAfter
from pytest_libero_max.pairing.runner import PairSettings, measure_pair, play_pair
from pytest_libero_max.policies.contract import Episode
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import AlterableWorld

from .actors import BUDGET, Approaching, make_case

BOTH = (PairSettings("fork"), PairSettings("replay"))


@dataclass(frozen=True)
class Nudge:
    """Puts the box a little aside; taken back, it puts the box where it was."""

    operation: ClassVar[str] = "nudge"

    offset_m: tuple[float, float, float]

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"pose:box_1"})

    def apply(self, world: AlterableWorld) -> Evidence:
        before = world.position("box_1")
        world.place("box_1", before + self.offset_m)
        after = world.position("box_1")
        return Evidence(
            self.operation, ("pose:box_1",), {"position_m": before.tolist()}, {"position_m": after.tolist()}
        )

    def scaled(self, strength: float) -> Nudge:
        x, y, z = self.offset_m
        return Nudge((x * strength, y * strength, z * strength))

    def reverted(self, evidence: Evidence) -> Any:
        if evidence.operation != self.operation:
            raise ChangeError("not mine")
        return PutBack(tuple(evidence.before["position_m"]))

    def to_dict(self) -> dict[str, Any]:
        return {"operation": self.operation, "offset_m": list(self.offset_m)}


@dataclass(frozen=True)
class PutBack(Nudge):
    """Puts the box at a place."""

    operation: ClassVar[str] = "put_back"

    def apply(self, world: AlterableWorld) -> Evidence:
        world.place("box_1", self.offset_m)
        return Evidence(self.operation, ("pose:box_1",), {}, {"position_m": world.position("box_1").tolist()})


class Counting(TinyWorld):
    """Counts the steps that it plays."""

    played = 0

    def step(self, action: Any) -> None:
        self.played += 1
        super().step(action)


@pytest.fixture(scope="module")
def world() -> Iterator[Counting]:
    world = Counting()
    yield world
    world.close()


def not_asked_again(policy: Approaching) -> Approaching:
    """The policy, which is asked no query twice."""
    policy.spec = replace(policy.spec, repeatable=False)
    return policy


NUDGE = Nudge((0.04, 0.03, 0.01))


def five_arms(distance_m: float, lasting: int, change: Any = NUDGE) -> tuple[Arm, ...]:
    near = Proximity("box_1", distance_m)
    return (
        Arm("base"),
        Arm("reset", (Entry(AtStart(), change),)),
        Arm("mid", (Entry(near, change),)),
        Arm("half", (Entry(near, change.scaled(0.5)),)),
        Arm("transient", (Entry(near, change), Entry(StepsAfter(lasting), Revert(0)))),
    )


@pytest.mark.parametrize("how", BOTH, ids=["fork", "replay"])
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    policy=strategies.scripted_policies(drift=(0.35, 0.53, -0.77)),
    distance_m=st.sampled_from([0.25, 0.3]),
    lasting=st.integers(1, 12),
)
def test_every_arm_equals_the_same_arm_played_alone_and_shared_parts_are_executed_once(
    how: PairSettings, world: Counting, policy: Any, distance_m: float, lasting: int
) -> None:
    case = make_case()
    arms = five_arms(distance_m, lasting)
    world.played = 0
    together = measure_pair(case, world, policy, how, arms=arms)
    played = world.played
    records = together.record.arms
    for arm in arms:
        alone = measure_pair(case, world, policy, how, arms=(arm,))
        assert structs.replace(records[arm.name], shares=None) == alone.record.arms[arm.name]
        one, other = together.rollouts[arm.name], alone.rollouts[arm.name]
        assert one.actions.tobytes() == other.actions.tobytes()
        assert one.end_effector.tobytes() == other.end_effector.tobytes()

    # Where each arm parted from one that was played before it.
    parted = {"reset": 0}
    if records["mid"].firings:
        parted |= {"mid": records["mid"].firings[0].step, "half": records["mid"].firings[0].step}
    if len(records["transient"].firings) == 2:
        parted["transient"] = records["transient"].firings[1].step
    shares = {name: arm.shares for name, arm in records.items()}
    assert shares == {
        "base": None,
        "reset": None,
        "mid": None if "mid" in parted else "base",
        "half": None if "half" in parted else "base",
        "transient": None if "transient" in parted else "mid" if "mid" in parted else "base",
    }
    steps = {name: arm.steps or 0 for name, arm in records.items()}
    own = steps["base"] + sum(steps[name] - step for name, step in parted.items())
    ways = sum(10 + step for step in parted.values()) if how.prefix == "replay" else 0
    assert played == 10 + own + ways
    event(f"parted: {sorted(parted)}")


def test_what_a_transient_event_did_is_taken_back(world: Counting) -> None:
    pair = measure_pair(make_case(), world, Approaching(wait=2), arms=five_arms(0.25, 6))
    transient = pair.record.arms["transient"]
    there, back = transient.firings
    assert back.step == there.step + 6
    assert there.evidence["operation"] == "nudge"
    assert back.evidence["operation"] == "put_back"
    assert back.evidence["after"]["position_m"] == there.evidence["before"]["position_m"]
    assert transient.schedule is not None
    assert transient.schedule[1]["reverts"] == 0
    moved = pair.rollouts["mid"].entity - pair.rollouts["transient"].entity
    assert not moved[: back.step].any()
    assert moved[back.step, 0] == pytest.approx(0.04, abs=0.01)


@pytest.mark.parametrize(
    "change",
    [
        SetLighting(0.2),
        ShiftCamera("agentview", (0.1, 0.0, 0.0), 5.0, 0.0),
        SetVisualTheme((2, 0, 1), (0.7, 1.15, 1.3)),
        SetSensorCorruption(24.0, 0.08, 7),
    ],
    ids=lambda change: change.operation,
)
def test_a_transient_change_of_pictures_ends_in_the_world_of_base_bit_for_bit(
    world: Counting, change: Change
) -> None:
    flash = (Entry(Proximity("box_1", 0.25), change), Entry(StepsAfter(4), Revert(0)))
    arms = (Arm("base"), Arm("dynamic", flash))
    rollouts = measure_pair(make_case(), world, Approaching(wait=2), arms=arms).rollouts
    base, dynamic = rollouts["base"].trajectory, rollouts["dynamic"].trajectory
    there, back = dynamic.firings
    assert back.step == there.step + 4
    assert dynamic.link != base.link
    assert (dynamic.step, dynamic.digest) == (base.step, base.digest)


def test_a_change_at_the_start_is_there_before_the_policy_begins(world: Counting) -> None:
    class Noting(Approaching):
        seen: ClassVar[list[tuple[str, float]]] = []

        def reset(self, episode: Episode) -> None:
            super().reset(episode)
            assert episode.world is not None
            self.seen.append((episode.instruction, episode.world.position("box_1")[0]))

    policy = not_asked_again(Noting(privileged=True))
    arms = (
        Arm("base"),
        Arm("moved", (Entry(AtStart(), NUDGE),)),
        Arm("told", (Entry(AtStart(), SetInstruction("leave the box alone")),)),
    )
    for how in BOTH:
        record = play_pair(make_case(), world, policy, how, arms=arms)
        assert record.instruction == world._language
        assert [firing.step for arm in record.arms.values() for firing in arm.firings] == [0, 0]
        assert record.arms["moved"].response_step == record.arms["moved"].stale_actions == 0
        assert record.arms["moved"].firings[0].prefix_proof == record.arms["told"].firings[0].prefix_proof
    (_, x), (_, moved), (told, same) = Noting.seen[:3]
    assert len(Noting.seen) == 6
    assert moved - x == pytest.approx(0.04)
    assert same == x
    assert told == "leave the box alone"


def test_an_entry_that_all_arms_have_happens_where_they_are(world: Counting) -> None:
    first = Entry(BudgetFraction(0.44), NUDGE)
    later = Entry(StepsAfter(4), NUDGE.scaled(0.5))
    arms = (Arm("once", (first,)), Arm("twice", (first, later)))
    world.played = 0
    record = play_pair(make_case(), world, Approaching(wait=30), arms=arms)
    once, twice = record.arms.values()
    assert once.firings == twice.firings[:1]
    assert [firing.step for firing in twice.firings] == [11, 15]
    assert world.played == 10 + BUDGET + BUDGET - 15


def test_several_entries_can_happen_at_one_step(world: Counting) -> None:
    near = Proximity("box_1", 0.25)
    other = Entry(Proximity("box_1", 0.4), NUDGE.scaled(0.25))
    arms = (Arm("base"), Arm("one", (Entry(near, NUDGE),)), Arm("two", (Entry(near, NUDGE), other)))
    for how in BOTH:
        record = play_pair(make_case(), world, Approaching(), how, arms=arms)
        first, second = record.arms["two"].firings
        assert first.step == second.step == record.arms["one"].firings[0].step
        assert first.prefix_proof != second.prefix_proof


def test_arms_without_one_in_which_nothing_happens_go_on_in_their_order(world: Counting) -> None:
    phases: list[str] = []
    strong, weak = (
        Arm(name, (Entry(AtStart(), NUDGE.scaled(s)),)) for name, s in (("strong", 1), ("weak", 0.5))
    )
    world.played = 0
    record = play_pair(make_case(), world, Approaching(), on_phase=phases.append, arms=(strong, weak))
    assert phases == ["setup", "strong", "weak"]
    assert world.played == 10 + 2 * BUDGET
    assert record.arms["strong"].proof != record.arms["weak"].proof


def test_a_repetition_is_played_from_the_start(world: Counting) -> None:
    policy = not_asked_again(Approaching(horizon=4, interval=4))
    world.played = 0
    record = play_pair(make_case(distance_m=1e-9), world, policy, arms=arms_of(make_case(), repeat_base=True))
    assert world.played == 2 * (10 + BUDGET) + BUDGET - (record.trigger_step or 0)
    assert len(policy.episodes) == 3
    assert record.base_repeat == {"success": False, "identical": True}
    assert record.arms["base_again"].shares is None


def test_a_repetition_that_ends_otherwise_is_noticed(world: Counting) -> None:
    class Unseeded(Approaching):
        draws = 0

        def predict(self, observation: Any, query: Any) -> Any:
            self.draws += 1
            return super().predict(observation, query) - 1e-3 * self.draws * np.eye(7)[2]

    policy = not_asked_again(Unseeded())
    record = play_pair(make_case(), world, policy, arms=arms_of(make_case(), repeat_base=True))
    assert record.base_repeat == {"success": False, "identical": False}


def test_two_arms_of_one_schedule_are_one(world: Counting) -> None:
    arms = (Arm("base"), Arm("control"), Arm("nothing", (Entry(AtStart(), Nothing()),)))
    world.played = 0
    record = play_pair(make_case(), world, Approaching(), arms=arms)
    base, control, nothing = record.arms.values()
    assert control == structs.replace(base, shares="base")
    assert nothing.shares is None
    assert nothing.proof == base.proof
    assert world.played == 10 + 2 * BUDGET


def test_what_goes_wrong_names_the_arm(world: Counting) -> None:
    class Failing(Approaching):
        def reset(self, episode: Episode) -> None:
            super().reset(episode)
            if len(self.episodes) == 3:
                raise ValueError("no such tensor")

    phases: list[str] = []
    policy = not_asked_again(Failing())
    with pytest.raises(AdapterError, match="ValueError in reset"):
        play_pair(make_case(), world, policy, on_phase=phases.append, arms=five_arms(0.25, 3))
    assert phases == ["setup", "base", "reset", "mid"]
    with pytest.raises(ManifestError, match="'base'"):
        play_pair(make_case(), world, Approaching(), arms=(Arm("base"), Arm("base")))


@pytest.mark.parametrize("name", ["camera_shift", "sensor_noise_onset", "target_relocation"])
def test_the_changes_of_the_benchmark_can_be_transient(world: Counting, name: str) -> None:
    case = make_case(name)
    change = change_from_dict(case.event.change)
    schedule = (Entry(Proximity("box_1", 0.25), change), Entry(StepsAfter(3), Revert(0)))
    fork, replay = (
        measure_pair(case, world, Approaching(), how, arms=(Arm("base"), Arm("transient", schedule)))
        for how in BOTH
    )
    assert fork.record.identity() == replay.record.identity()
    there, back = fork.record.arms["transient"].firings
    assert there.evidence["operation"] == change.operation
    assert back.evidence["operation"] == "revert"
    assert world.filters == ()
    if name != "target_relocation":  # neither a camera nor pixels move anything
        assert fork.rollouts["transient"].end_effector.tobytes() == fork.base.end_effector.tobytes()
        assert world.model.cam_pos.tobytes() == TinyWorld().model.cam_pos.tobytes()
