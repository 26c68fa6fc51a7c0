"""Diagnosis: policies that are made to fail in one known way, each named right, on embedded scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from msgspec import structs

from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.pairing.record import PROGRAM, PairRecord
from pytest_libero_max.pairing.runner import play_pair
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.report.diagnosis import CAUSES, Diagnosis, diagnose
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from tests.report.faults import first, second
from tests.report.faults.judge import play
from tests.short_episodes import shorten_here

FAULTS = {fault.name: fault for fault in (*first.FAULTS, *second.FAULTS)}

AFTER_THE_EVENT = {
    "old_place": "missed_moved_target",
    "old_goal": "missed_moved_goal",
    "freezes": "froze_after_event",
    "holds": "timed_out_holding",
    "drops": "dropped",
    "waits_above": "never_closed",
    "slow": "timed_out",
    "runs_into_the_obstacle": "blocked_by_obstacle",
    "grasps_beside": "grasp_missed",
    "half_open": "part_moved_too_little",
}
IN_BASE = {"takes_another": "wrong_object", "fist": "closed_early"}
"""Faults with their causes, of a policy that is broken once the world has changed, or always."""

PLAYED: dict[tuple[str, bool], PairRecord] = {}


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time for an expert to succeed, and not much more for what fails."""
    shorten_here(monkeypatch, 150)


def failed(name: str, substrate: EmbeddedSubstrate, *, always: bool = False) -> PairRecord:
    """The pair in which a fault is played; one a module."""
    if (name, always) not in PLAYED:
        (item,) = play(FAULTS[name], 1, 0, substrate, always)
        PLAYED[name, always] = item.record
    return PLAYED[name, always]


def diagnosed(record: PairRecord, arm: str) -> Diagnosis:
    found = diagnose(record, arm)
    assert found is not None
    assert found.cause in CAUSES
    return found


@pytest.mark.parametrize(("name", "cause"), AFTER_THE_EVENT.items())
def test_a_regression_is_named_by_the_way_in_which_the_policy_was_broken(
    name: str, cause: str, substrate: EmbeddedSubstrate
) -> None:
    record = failed(name, substrate)
    assert record.base_success
    assert diagnose(record, "base") is None
    found = diagnosed(record, "dynamic")
    assert found.cause == cause, found.sentence


@pytest.mark.parametrize(("name", "cause"), IN_BASE.items())
def test_a_failure_in_base_is_named_there_and_said_to_be_old_in_dynamic(
    name: str, cause: str, substrate: EmbeddedSubstrate
) -> None:
    record = failed(name, substrate, always=True)
    found = diagnosed(record, "base")
    assert found.cause == cause, found.sentence
    assert diagnosed(record, "dynamic").cause == "already_failing_in_base"


@pytest.mark.parametrize(("name", "cause"), [("noop", "not_attempted"), ("random", "never_reached")])
def test_policies_that_know_nothing_fail_in_base(name: str, cause: str, substrate: EmbeddedSubstrate) -> None:
    case, policy = make_case("camera_shift", "libero_spatial", 0, variant=1), load_policy(name)
    policy.spec = replace(policy.spec, cameras=())
    assert diagnosed(play_pair(case, substrate.world(case), policy), "base").cause == cause


def test_a_goal_that_is_pushed_after_a_missed_grasp_is_not_the_cause(substrate: EmbeddedSubstrate) -> None:
    record = failed("grasps_beside", substrate)
    stages = record.arms["dynamic"].probes["stages"]
    later = {"moved": [stages["goal"][0].split(" ")[2]], "moved_step": [140], "moved_m": [0.08]}
    pushed = structs.replace(record.arms["dynamic"], probes={"stages": {**stages, **later}})
    found = diagnosed(structs.replace(record, arms={**record.arms, "dynamic": pushed}), "dynamic")
    assert found.cause == "grasp_missed", found.sentence


def test_the_sentence_of_a_program_tells_what_it_did_and_not_the_event_of_the_case(
    substrate: EmbeddedSubstrate,
) -> None:
    record = failed("freezes", substrate)
    assert diagnosed(record, "dynamic").sentence.startswith("Illumination switch ")
    program = structs.replace(record, fingerprints={**record.fingerprints, PROGRAM: "dark 0"})
    assert diagnosed(program, "dynamic").sentence.startswith("Light changed ")
