from __future__ import annotations

import pytest
from msgspec.structs import replace

from pytest_libero_max.runs.progress import PairCounts, Progress, progress_text
from tests.report.made_up import POLICY, error_of, plan, record_of

PLAN = plan()


def _counts(short_s: float = 2.0, long_s: float = 8.0, policy: object = POLICY) -> PairCounts:
    """Thirty-two pairs, of which four short ones and four long ones of another task are measured."""
    pairs = [replace(pair, task=f"libero_spatial/{number % 2}") for number, pair in enumerate(PLAN)]
    counts = PairCounts(pairs)
    for number, pair in enumerate(pairs[:8]):
        seconds = long_s if number % 2 else short_s
        timings = {"pair_s": seconds, "reset_s": seconds}
        counts.add(record_of(pair, True, True, timings=timings, policy=policy))
    return counts


def test_the_pairs_that_are_left_take_what_the_measured_ones_took() -> None:
    progress = Progress(32, _counts(), seconds=20.0)  # two pairs at once: 40 s of pairs in 20 s
    assert progress.seconds_left == pytest.approx(24 * 5.0 / 2)
    assert "8 of 32 pairs, P 8 R 0 N 0 E 0, 24.0/min, 60 s left" in progress_text(progress)


def test_what_is_being_played_is_partly_done() -> None:
    playing = {PLAN[8].item_id: 2.0, PLAN[9].item_id: 2.0}
    progress = Progress(32, _counts(), seconds=22.0, playing=playing)
    assert progress.seconds_left == pytest.approx((24 * 5.0 - 4.0) / 2)


def test_the_longest_of_the_last_pairs_decides() -> None:
    counts = _counts(5.0, 5.0)
    for pair in PLAN[8:31]:
        counts.add(record_of(replace(pair, task="libero_spatial/0"), True, True, timings={"pair_s": 5.0}))
    progress = Progress(32, counts, seconds=10.0, playing={PLAN[31].item_id: 1.0})
    assert progress.seconds_left == pytest.approx(4.0, abs=1.5)


def test_an_error_is_not_played_again() -> None:
    counts = _counts()
    pair = PLAN[8]
    counts.add(error_of(pair))
    assert Progress(32, counts, seconds=20.0).seconds_left == pytest.approx(23 * 5.0 / 2)


def test_a_resumed_run_knows_its_time_before_its_first_pair() -> None:
    playing = {PLAN[8].item_id: 3.0, PLAN[9].item_id: 3.0}
    progress = Progress(32, _counts(), before=8, seconds=3.0, playing=playing)
    assert progress.per_minute is None
    assert progress.seconds_left == pytest.approx((24 * 5.0 - 6.0) / 2)
    assert "8 of 32 pairs, P 8 R 0 N 0 E 0, 57 s left" in progress_text(progress)


def test_suites_that_the_policy_does_not_play_take_no_time() -> None:
    pairs = [*PLAN[:8], *(replace(pair, suite="libero_goal", task="libero_goal/0") for pair in PLAN[8:])]
    counts = PairCounts(pairs)
    for pair in pairs[:8]:
        policy = {**POLICY, "suites": ["libero_spatial"]}
        counts.add(record_of(pair, True, True, timings={"pair_s": 5.0}, policy=policy))
    assert Progress(32, counts, seconds=20.0).seconds_left == 0.0


def test_records_without_timings_leave_the_pace() -> None:
    counts = PairCounts(PLAN)
    for pair in PLAN[:8]:
        counts.add(record_of(pair, True, True, timings={}))
    assert Progress(32, counts, seconds=20.0).seconds_left == pytest.approx(60.0)
