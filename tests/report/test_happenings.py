"""What happened in an arm is told in words: the event, or what a program did in its place."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes.registry import _KINDS
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PROGRAM, ArmRecord, PairRecord
from pytest_libero_max.report.happenings import _WAITS, _WORDS, happenings, happenings_text
from tests.report.made_up import plan, record_of

RECORD = record_of(plan()[0], True, False)
EVENT = RECORD.event.replace("_", " ").capitalize()


def of_program(record: PairRecord) -> PairRecord:
    return structs.replace(record, fingerprints={**record.fingerprints, PROGRAM: "made_up 0"})


def played(*entries: tuple[int, str | int]) -> ArmRecord:
    """An arm in which at each step an operation happens, or an earlier entry is taken back."""
    arm = RECORD.arms["dynamic"]
    trigger: Json = {"trigger": {"type": "at_start"}}
    schedule = tuple(
        trigger | ({"reverts": what} if isinstance(what, int) else {"change": {"operation": what}})
        for _, what in entries
    )
    firings = tuple(structs.replace(arm.firings[0], step=step) for step, _ in entries)
    return structs.replace(arm, schedule=schedule, firings=firings)


def said(*entries: tuple[int, str | int]) -> str:
    return happenings_text(happenings(of_program(RECORD), played(*entries)))


def test_the_event_of_a_case_has_its_name() -> None:
    arm = RECORD.arms["dynamic"]
    (found,) = happenings(RECORD, arm)
    assert (found.name, found.is_event) == (RECORD.event, True)
    assert happenings_text([found]) == f"{EVENT} at step 23"
    assert happenings_text(happenings(RECORD, RECORD.arms["base"])) == ""


@pytest.mark.parametrize(
    ("entries", "text"),
    [
        ([(20, "delay_answers")], "Answers delayed at step 20"),
        ([(20, "shift_camera")], "Camera moved at step 20"),
        ([(20, "freeze_images"), (40, 0)], "Pictures frozen at step 20, taken back at step 40"),
        ([(20, "nothing"), (35, "bump_object")], "Object bumped at step 35"),
        ([(20, "set_lighting"), (20, "move_object")], "Light changed at step 20 and object moved at step 20"),
        ([(20, "move_object"), (21, "move_object")], "Object moved 2 times from step 20 to 21"),
        (
            [(20, "hide_inputs"), (30, 0), (40, "hide_inputs"), (50, 2)],
            "Inputs hidden 2 times from step 20 to 40, taken back 2 times from step 30 to 50",
        ),
        ([(20, "of_another_package")], "Of another package at step 20"),
        ([(20, "nothing")], ""),
    ],
)
def test_a_program_is_told_by_its_changes_and_never_by_the_event(entries: Any, text: str) -> None:
    assert said(*entries) == text


def test_every_change_that_ships_has_words() -> None:
    assert {kind.operation for kind in _KINDS} == {*_WORDS, _WAITS}


@pytest.mark.parametrize(
    "entries", [[(20, 0)], [(20, 1), (21, "nothing")], [(20, "nothing"), (21, 0), (22, 1)]]
)
def test_a_record_that_takes_back_what_is_no_earlier_change_is_refused(entries: Any) -> None:
    with pytest.raises(ReportError, match="reversal of an earlier"):
        ArmRecord.from_dict(played(*entries).to_dict())
