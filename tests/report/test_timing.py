"""Times of made-up pairs, against what can be worked out by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import Rows, measures_of
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.render.drawing import survival_curves
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import PlayedPairs
from pytest_libero_max.report.timing import NOTE, TITLE, Timing, success_curves
from pytest_libero_max.stats.blocks import Measure
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, plan, record_of, stopped_rows

PAIRS = plan()


def took(number: int, base: int | None, dynamic: int | None, **changes: Any) -> PairRecord:
    """A pair whose arms succeed after so many steps, or never in 220; its event is at step 23."""
    steps = {"base_steps": base or 220, "dynamic_steps": dynamic or 220}
    return record_of(PAIRS[number], base is not None, dynamic is not None, **steps, **changes)


def rows(records: Sequence[PairRecord], *, with_intervals: bool = True) -> Rows:
    tasks = [str(number) for number in range(len(records))]
    table = Timing().tables(PlayedPairs(records, tasks, with_intervals=with_intervals))[TITLE]
    return table if with_intervals else stopped_rows(table)


def measures(records: Sequence[PairRecord], *, with_intervals: bool = True) -> dict[str, Measure]:
    """The numbers by the ends of their keys, after ``timing.``."""
    found = measures_of({TITLE: rows(records, with_intervals=with_intervals)})
    return {key.removeprefix("timing."): measure for key, measure in found.items()}


def counts(measure: Measure) -> tuple[float | None, int | None, int | None]:
    """A median, the pairs that have it, and all of them."""
    return measure.value, measure.count, measure.of


def staged(record: PairRecord, base: list[int | None], dynamic: list[int | None]) -> PairRecord:
    """The pair with these touch, grasp and lift steps of the only fact of its goal."""
    names, arms = ("touch_step", "grasp_step", "lift_step"), {}
    for name, steps in (("base", base), ("dynamic", dynamic)):
        stages: dict[str, list[int | None]] = {"above_step": [None], "satisfied_step": [None]}
        stages |= {stage: [step] for stage, step in zip(names, steps, strict=True)}
        arms[name] = replace(record.arms[name], probes={"stages": stages})
    return replace(record, arms=arms)


def test_an_episode_without_success_counts_with_its_horizon() -> None:
    found = measures([took(0, 100, 120), took(1, 80, None), took(2, None, None)])
    assert found["mean.base"].value == pytest.approx((100 + 80 + 220) / 3)
    assert found["mean.dynamic"].value == pytest.approx((120 + 220 + 220) / 3)
    change = found["mean.change"]
    assert change.value == pytest.approx(160 / 3)
    assert change.lower is None
    assert re.findall(r"\d+", change.lack) == ["2", "10"]
    assert counts(found["success.base"]) == (67.0, 2, 3)
    assert counts(found["success.dynamic"]) == (97.0, 1, 3)
    assert counts(found["success.change"]) == (20.0, 1, 3)


def test_the_area_under_a_curve_is_the_restricted_mean() -> None:
    records = [
        took(number, 60 + 3 * number, None if number % 4 == 0 else 90 + number) for number in range(32)
    ]
    curves = success_curves(records)
    assert curves is not None
    assert (curves.steps[0], curves.steps[-1], curves.pairs) == (0, 220, 32)
    for counted, arm in ((curves.base, "base"), (curves.dynamic, "dynamic")):
        widths = [after - before for before, after in zip(curves.steps, curves.steps[1:], strict=False)]
        area = sum(width * count for width, count in zip(widths, counted, strict=False)) / 32
        assert measures(records)[f"mean.{arm}"].value == pytest.approx(area)


def test_intervals_are_there_where_there_is_enough_and_no_rule_has_ended_the_run() -> None:
    records = [took(number, 80 + number, 90 + number * number % 37) for number in range(32)]
    found = measures(records)
    assert {key for key, measure in found.items() if measure.lower is not None} >= {
        "mean.change",
        "mean.change_clustered",
        "success.base",
    }
    assert rows(records)["Tasks"] == 32
    assert all(one.lower is None for one in measures(records, with_intervals=False).values())


def test_the_next_stage_is_one_that_was_not_reached_before_the_event() -> None:
    again = staged(took(0, None, None), [10, 30, 44], [10, 60, 80])
    never = staged(took(1, None, None), [10, 20, 50], [10, 20, None])
    success = staged(took(2, 90, 70), [10, 20, 22], [10, 20, 22])
    found = measures([again, never, success, took(3, 100, 100)])
    assert counts(found["next_stage.base"]) == (27.0, 3, 4)  # 30, 50, 90 less 23
    assert counts(found["next_stage.dynamic"]) == (42.0, 2, 4)  # 60, 70 less 23
    assert counts(found["next_stage.change"]) == (5.0, 2, 4)


def test_way_and_jerk_are_divided_at_the_event() -> None:
    def moved(arm: Any, ways: list[float], jerks: list[float]) -> Any:
        motion = {"path_m": 0.0, "jerk_m_s3": 0.0, "step_m": ways, "step_jerk_m_s3": jerks}
        return replace(arm, probes={"motion": motion})

    record = took(0, 27, 29)
    before = [0.01] * 23, [2.0] * 21
    arms = {
        "base": moved(record.arms["base"], before[0] + [0.02] * 4, [*before[1], 9.0, 9.0, 3.0, 4.0]),
        "dynamic": moved(record.arms["dynamic"], before[0] + [0.02] * 6, [*before[1], 9.0, 9.0, *[10.0] * 4]),
    }
    records = [replace(record, arms=arms), took(1, 90, 90)]
    assert rows(records)["Pairs whose motion was watched"] == 1
    found = measures(records)
    for key, value in (
        ("way.before", 0.23),
        ("way.base", 0.08),
        ("way.ratio", 1.5),
        ("jerk.before", 2.0),
        ("jerk.base", math.sqrt(12.5)),
        ("jerk.ratio", 10 / math.sqrt(12.5)),
    ):
        assert found[key].value == pytest.approx(value)
        assert (found[key].count, found[key].of) == (1, 1)


def test_nothing_is_said_of_what_there_is_not() -> None:
    assert Timing().tables(PlayedPairs([])) == {}
    assert success_curves([]) is None
    records = [took(0, None, None), took(1, 90, 90, dynamic_digest=None, **_quiet())]
    assert rows(records)["Pairs with an event"] == 1
    assert counts(measures(records)["success.dynamic"]) == (None, 0, 1)
    assert not any("motion" in name for name in rows(records))


def _quiet() -> dict[str, Any]:
    return {name: value for name, value in NEVER_TRIGGERED.items() if name != "dynamic_digest"} | {
        "base_digest": "cd" * 32
    }


@pytest.mark.parametrize("ends", [(90, 90), (90, None), (None, None)])
def test_it_is_in_report_and_page(ends: tuple[int | None, int | None]) -> None:
    records = [took(number, *ends) for number in range(4)]
    report = build_report(records, [], PAIRS[:8], PROVENANCE)
    assert f"## {TITLE}\n\n{NOTE}\n" in markdown(report)
    page = html(report, [], [])
    assert f"<h2>{TITLE}</h2><p>{NOTE}</p>" in page
    assert f"<figure>{survival_curves(report.success_curves)}" in page
    assert report.success_curves is not None
    left = [0 if end else 4 for end in ends]
    assert [report.success_curves.base[-1], report.success_curves.dynamic[-1]] == left


def test_a_report_without_pairs_has_no_times() -> None:
    report = build_report([], [], PAIRS, PROVENANCE)
    assert report.success_curves is None
    assert TITLE not in markdown(report) + html(report, [], [])
