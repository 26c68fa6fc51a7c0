from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from pytest_libero_max.changes import MoveObject, SetSensorCorruption, ShiftCamera
from pytest_libero_max.errors import ChangeError, ManifestError
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of, check_arms, schedule_from_list
from pytest_libero_max.events.triggers import AtStart, BudgetFraction, Proximity, StepsAfter
from tests.pairing.actors import make_case

SHIFT = ShiftCamera("agentview", (0.1, 0.0, 0.0), 5.0, 0.0)
NOISE = SetSensorCorruption(24.0, 0.08, 7)
NEAR = Proximity("box_1")
TRANSIENT = (Entry(NEAR, SHIFT), Entry(StepsAfter(5), Revert(0)))


def test_a_case_has_two_arms_and_a_third_where_base_is_repeated() -> None:
    case = make_case(distance_m=0.25)
    base, dynamic = arms_of(case)
    assert (base, dynamic.name) == (Arm("base"), "dynamic")
    assert dynamic.schedule == (Entry(Proximity("box_1", 0.25), SHIFT),)
    assert arms_of(case, repeat_base=True)[2] == Arm("base_again", repetition=1)


def test_a_schedule_survives_json() -> None:
    schedule = (
        *TRANSIENT,
        Entry(BudgetFraction(0.5), NOISE),
        Entry(AtStart(), MoveObject("box_1", (0.1, 0, 0))),
    )
    written = json.loads(json.dumps([entry.to_dict() for entry in schedule]))
    assert schedule_from_list(written) == schedule
    assert written[1] == {"trigger": {"type": "steps_after", "steps": 5, "entry": -1}, "reverts": 0}


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ({}, "schedule must be a list of entries, not dict"),
        ([{"trigger": {"type": "at_start"}}], r"schedule\[0\] lacks change"),
        ([{"trigger": {"type": "at_start"}, "reverts": "0"}], r"schedule\[0\].reverts='0'"),
        (
            [{"trigger": {"type": "later"}, "reverts": 0}],
            r"schedule\[0\].trigger.type='later' is not a trigger",
        ),
    ],
)
def test_a_schedule_that_is_spelled_wrong_says_where(raw: Any, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        schedule_from_list(raw)
    with pytest.raises(ChangeError, match="operation='shift' is not a change"):
        schedule_from_list([{"trigger": {"type": "at_start"}, "change": {"operation": "shift"}}])


@pytest.mark.parametrize(
    ("schedule", "message"),
    [
        ((Entry(StepsAfter(3), SHIFT),), "has no entry before it to count from"),
        ((Entry(NEAR, SHIFT), Entry(StepsAfter(3, entry=1), Revert(0))), "must refer to an earlier entry"),
        ((Entry(NEAR, Revert(0)),), "must name an earlier entry"),
        (
            (*TRANSIENT, Entry(StepsAfter(3), Revert(1))),
            "must name an earlier entry",
        ),
        ((*TRANSIENT, Entry(StepsAfter(3), Revert(0))), "entry 0 is taken back already"),
    ],
)
def test_an_entry_refers_to_what_comes_before_it(schedule: tuple[Entry, ...], message: str) -> None:
    with pytest.raises(ManifestError, match=f"^arm 'transient', entry .*{message}"):
        Arm("transient", schedule)


@pytest.mark.parametrize("name", ["", "Base", "2nd", "mid-task", 3])
def test_an_arm_has_a_plain_name(name: Any) -> None:
    with pytest.raises(ManifestError, match="lower-case"):
        Arm(name)


def test_arms_have_names_of_their_own() -> None:
    with pytest.raises(ManifestError, match="'base'"):
        check_arms([Arm("base"), Arm("base", TRANSIENT)])
    with pytest.raises(ManifestError, match="no arm given"):
        check_arms([])


def test_schedules_load_no_simulator() -> None:
    code = (
        "import sys, pytest_libero_max.events.schedules, pytest_libero_max.pairing.record\n"
        "heavy = {'mujoco', 'robosuite', 'numba', 'cv2', 'scipy', 'numpy'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
