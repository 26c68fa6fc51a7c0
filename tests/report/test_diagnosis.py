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
from tests.report.faults.judge import Played, play
from tests.short_episodes import shorten_here

FAULTS = {fault.name: fault for fault in (*first.FAULTS, *second.FAULTS)}

AFTER_THE_EVENT = (
    *("old_place", "old_goal", "freezes", "holds", "drops", "waits_above", "slow"),
    *("runs_into_the_obstacle", "grasps_beside", "half_open"),
)
IN_BASE = ("takes_another", "fist")
"""Faults of a policy that is broken once the world has changed, or always."""

PLAYED: dict[tuple[str, bool], Played] = {}


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time for an expert to succeed, and not much more for what fails."""
    shorten_here(monkeypatch, 150)


def failed(name: str, substrate: EmbeddedSubstrate, *, always: bool = False) -> Played:
    """The pair in which a fault is played, with the causes that are right for it."""
    if (name, always) not in PLAYED:
        (PLAYED[name, always],) = play(FAULTS[name], 1, 0, substrate, always)
    return PLAYED[name, always]


def diagnosed(record: PairRecord, arm: str) -> Diagnosis:
    found = diagnose(record, arm)
    assert found is not None
    assert found.cause in CAUSES
    return found


@pytest.mark.parametrize("name", AFTER_THE_EVENT)
def test_a_regression_is_named_by_the_way_in_which_the_policy_was_broken(
    name: str, substrate: EmbeddedSubstrate
) -> None:
    played = failed(name, substrate)
    assert played.record.base_success
    assert diagnose(played.record, "base") is None
    found = diagnosed(played.record, "dynamic")
    assert found.cause in played.accepted, found.sentence


@pytest.mark.parametrize("name", IN_BASE)
def test_a_failure_in_base_is_named_there_and_said_to_be_old_in_dynamic(
    name: str, substrate: EmbeddedSubstrate
) -> None:
    played = failed(name, substrate, always=True)
    found = diagnosed(played.record, "base")
    assert found.cause in played.accepted, found.sentence
    assert diagnosed(played.record, "dynamic").cause == "already_failing_in_base"


@pytest.mark.parametrize(("name", "cause"), [("noop", "not_attempted"), ("random", "never_reached")])
def test_policies_that_know_nothing_fail_in_base(name: str, cause: str, substrate: EmbeddedSubstrate) -> None:
    case, policy = make_case("camera_shift", "libero_spatial", 0, variant=1), load_policy(name)
    policy.spec = replace(policy.spec, cameras=())
    assert diagnosed(play_pair(case, substrate.world(case), policy), "base").cause == cause


def test_a_goal_that_is_pushed_after_a_missed_grasp_is_not_the_cause(substrate: EmbeddedSubstrate) -> None:
    record = failed("grasps_beside", substrate).record
    stages = record.arms["dynamic"].probes["stages"]
    later = {"moved": [stages["goal"][0].split(" ")[2]], "moved_step": [140], "moved_m": [0.08]}
    pushed = structs.replace(record.arms["dynamic"], probes={"stages": {**stages, **later}})
    found = diagnosed(structs.replace(record, arms={**record.arms, "dynamic": pushed}), "dynamic")
    assert found.cause == "grasp_missed", found.sentence


def test_the_sentence_of_a_program_tells_what_it_did_and_not_the_event_of_the_case(
    substrate: EmbeddedSubstrate,
) -> None:
    record = failed("freezes", substrate).record
    assert diagnosed(record, "dynamic").sentence.startswith("Illumination switch ")
    program = structs.replace(record, fingerprints={**record.fingerprints, PROGRAM: "dark 0"})
    assert diagnosed(program, "dynamic").sentence.startswith("Light changed ")
