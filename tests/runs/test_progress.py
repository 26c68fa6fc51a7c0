from __future__ import annotations

import time
from itertools import pairwise

import pytest

from pytest_libero_max.pairing.record import PairError
from pytest_libero_max.runs.progress import (
    Pace,
    PairCounts,
    Progress,
    duration,
    letters_text,
    playing_lines,
    progress_text,
    status,
)
from tests.report.made_up import NEVER_TRIGGERED, error_of, plan, record_of

PLAN = plan()


def _error(number: int) -> PairError:
    pair = PLAN[number]
    return error_of(pair)


def _counts() -> PairCounts:
    counts = PairCounts()
    for number, (base, dynamic) in enumerate([(True, True), (True, False), (False, False), (True, True)]):
        counts.add(record_of(PLAN[number], base, dynamic))
    counts.add(record_of(PLAN[4], True, True, **NEVER_TRIGGERED))
    counts.add(_error(5))
    return counts


def test_the_line_says_how_far_the_run_is() -> None:
    progress = Progress(32, _counts(), before=2, seconds=120.0)
    assert progress_text(progress) == "6 of 32 pairs, P 2 R 1 N 1 U 1 E 1, 2.0/min, 13 min left"
    now = time.mktime((2026, 3, 4, 23, 30, 0, 0, 0, -1))
    assert "left (ready at 23:43)" in progress_text(progress, now)
    assert "(ready at 03-05 00:03)" in progress_text(progress, now + 1200)


def test_nothing_is_said_of_a_pace_that_is_not_known() -> None:
    assert progress_text(Progress(4, PairCounts())) == "0 of 4 pairs, P 0 R 0 N 0 E 0"
    assert progress_text(Progress(32, _counts(), before=6, seconds=9.0)).startswith("6 of 32 pairs, P")
    assert progress_text(Progress(6, _counts(), seconds=60.0)) == "6 of 6 pairs, P 2 R 1 N 1 U 1 E 1, 6.0/min"


def test_a_pair_that_is_measured_after_an_error_is_no_error() -> None:
    counts = _counts()
    counts.add(_error(6))
    counts.add(record_of(PLAN[5], False, True))
    assert counts.letters[PLAN[5].item_id] == "G"
    assert letters_text(counts) == "P 2 G 1 R 1 N 1 U 1 E 1 (1 more error, played again)"


def test_the_pair_that_plays_longest_comes_first() -> None:
    progress = Progress(4, PairCounts(), playing={"a": 3.0, "b": 200.0})
    assert playing_lines(progress) == ["playing for 3 min: b", "playing for 3 s: a"]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (-1, "0 s"),
        (89.4, "89 s"),
        (90, "2 min"),
        (3600, "60 min"),
        (5400, "1 h 30 min"),
        (39900, "11 h 05 min"),
    ],
)
def test_durations_are_said_as_people_do(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_lines_become_rarer() -> None:
    pace = Pace(0.0)
    due = [second for second in range(0, 40 * 3600, 10) if pace.due(second)]
    assert due[:3] == [60, 120, 180]
    gaps = [after - before for before, after in pairwise(due)]
    assert gaps == sorted(gaps)
    assert gaps[-1] == 600
    assert not pace.due(due[-1] + 1)


@pytest.mark.parametrize(
    ("base", "dynamic", "letter"),
    [(True, True, "P"), (False, True, "G"), (True, False, "R"), (False, False, "N")],
)
def test_each_outcome_has_its_letter(base: bool, dynamic: bool, letter: str) -> None:
    assert status(record_of(PLAN[0], base, dynamic))[:2] == ("passed", letter)


def test_an_event_that_never_fired_has_a_letter_of_its_own() -> None:
    record = record_of(PLAN[0], True, True, **{**NEVER_TRIGGERED, "min_distance_m": 0.314})
    assert status(record) == (
        "passed",
        "U",
        "UNTRIGGERED (Base succeeds after 90, never within reach: 0.31 m at best)",
    )


def test_the_sentence_tells_the_pair() -> None:
    record = record_of(PLAN[0], True, False, stale_actions=1, response_step=24, dynamic_steps=220)
    assert status(record)[2] == (
        "REGRESSION (Base succeeds after 90, event at step 23, 1 stale action, Dynamic fails after 220)"
    )
