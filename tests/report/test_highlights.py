from __future__ import annotations

import csv
import io
import re

from msgspec import structs

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.run_tables import csv_text
from pytest_libero_max.runs.plan import PlannedPair
from tests.report.made_up import PROVENANCE, plain, plan, record_of

PAIRS = [
    PlannedPair(**{**structs.asdict(pair), "source_category": f"Part {number % 2}"})
    for number, pair in enumerate(plan())
]


def _outcome(pair: PlannedPair) -> tuple[bool, bool]:
    """Part 1 fails in Base; Plus loses in part 0, and PRO loses nothing."""
    base = pair.source_category == "Part 0"
    return base, base and pair.source == "pro"


REPORT = build_report([record_of(pair, *_outcome(pair)) for pair in PAIRS], [], PAIRS, PROVENANCE)


def test_the_extreme_categories_of_each_source_are_named() -> None:
    assert plain(REPORT)["extremes"] == {
        "plus": {"lowest_base_success": "plus-part_1", "largest_loss": "plus-part_0"},
        "pro": {"lowest_base_success": "pro-part_1", "largest_loss": "pro-part_0"},
    }
    rows = {what: (where, value) for what, where, value in highlight_rows(REPORT)}
    where, value = next(row for what, row in rows.items() if "Base success, plus" in what)
    assert where == "plus-part_1"
    assert re.match(r"0\.0%, .* of 2; [\d.]+% expected", value)
    where, value = next(row for what, row in rows.items() if "change, plus" in what)
    assert where == "plus-part_0"
    assert value.startswith("-100.0 pp, ")
    assert next(iter(rows.values())) == ("4 source categories", "50.0% to 25.0%, -25.0 pp")


def test_what_chance_explains_is_no_finding() -> None:
    alike = build_report([record_of(pair, True, True) for pair in PAIRS], [], PAIRS, PROVENANCE)
    rows = highlight_rows(alike)
    assert {where for _, where, _ in rows[1:]} == {"none stands out"}
    assert re.findall(r"[\d.]+%", rows[1][2]) == ["100.0%", "100.0%"]
    one = [record_of(pair, True, number > 0) for number, pair in enumerate(PAIRS)]
    single = dict.fromkeys(highlight_rows(build_report(one, [], PAIRS, PROVENANCE)))
    assert all("none stands out" in row for row in single if row[0].startswith(("Lowest", "Largest")))


def test_a_split_beyond_chance_names_its_variants() -> None:
    many = plan(per_cell=40)
    lost = [record_of(pair, True, not (pair.event == "camera_shift" and pair.variant == 1)) for pair in many]
    (split,) = [row for row in highlight_rows(build_report(lost, [], many, PROVENANCE)) if "split" in row[0]]
    assert split[1] == "camera_shift"
    assert re.findall(r"[+\d.]+ pp|v\d [\d.]+%", split[2])[:3] == ["+100.0 pp", "v0 100.0%", "v1 0.0%"]


def test_csv_holds_averages_and_extremes() -> None:
    rows = {(row["dimension"], row["group"]): row for row in csv.DictReader(io.StringIO(csv_text(REPORT)))}
    assert float(rows["macro", "category"]["paired_change"]) == -0.25
    assert rows["macro", "category"]["planned"] == ""
    assert rows["largest_loss.plus", "plus-part_0"]["regression"] == "8"
    assert rows["lowest_base_success.pro", "pro-part_1"]["base_success"] == "0.0"
    assert rows["largest_split", "illumination_switch-v0"]["played"] == "2"


def test_nothing_played_has_no_extremes_and_says_so() -> None:
    empty = build_report([], [], PAIRS, PROVENANCE)
    assert plain(empty)["extremes"] == {}
    assert ["n/a" in row[1] + row[2] for row in highlight_rows(empty)] == [True, True]
    assert csv_text(empty)
