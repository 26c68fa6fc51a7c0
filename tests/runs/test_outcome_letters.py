from __future__ import annotations

import pytest

from pytest_libero_max.runs.outcome_letters import status
from tests.report.made_up import NEVER_TRIGGERED, plan, record_of

PAIR = plan()[0]


@pytest.mark.parametrize(
    ("base", "dynamic", "letter"),
    [(True, True, "P"), (False, True, "G"), (True, False, "R"), (False, False, "N")],
)
def test_each_outcome_has_its_letter(base: bool, dynamic: bool, letter: str) -> None:
    assert status(record_of(PAIR, base, dynamic))[:2] == ("passed", letter)


def test_an_event_that_never_fired_has_a_letter_of_its_own() -> None:
    record = record_of(PAIR, True, True, **{**NEVER_TRIGGERED, "min_distance_m": 0.314})
    assert status(record) == (
        "passed",
        "U",
        "UNTRIGGERED (Base succeeds after 90, never within reach: 0.31 m at best)",
    )


def test_the_sentence_tells_the_pair() -> None:
    record = record_of(PAIR, True, False, stale_actions=1, response_step=24, dynamic_steps=220)
    assert status(record)[2] == (
        "REGRESSION (Base succeeds after 90, event at step 23, 1 stale action, Dynamic fails after 220)"
    )
