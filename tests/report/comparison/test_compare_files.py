from __future__ import annotations

import re
from pathlib import Path

import pytest
from markupsafe import escape

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs
from pytest_libero_max.report.comparison.compare_files import (
    comparison_figures,
    comparison_html,
    comparison_markdown,
    event_changes,
    outcome_shares,
    write_comparison,
)
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.statements import STATEMENTS
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import page_cases, plain, plan, record_of, run_of, write_run
from tests.report.svg_frame import SVG, parsed_inside

PAIRS = plan()


def _runs(runs: int) -> dict[str, StoredRun]:
    """Run k loses the pairs whose number divides by k + 2, and its Base fails in two of the 32."""
    return {
        f"run {k} & <co>": run_of(
            PAIRS,
            (record_of(pair, at > 1, at > 1 and at % (k + 2) > 0) for at, pair in enumerate(PAIRS)),
        )
        for k in range(runs)
    }


def _comparison(runs: int) -> Comparison:
    return compare_runs(_runs(runs))


THREE = _comparison(3)


@pytest.mark.parametrize("runs", [2, 5])
def test_every_figure_is_well_formed_and_inside_its_frame(runs: int) -> None:
    for svg in comparison_figures(_comparison(runs)).values():
        assert "run 1 & <co>" in [shape.text for shape in parsed_inside(svg).iter(f"{SVG}text")]


@pytest.mark.parametrize(("count", "boxes"), [(2, 0), (3, 0), (5, 8)])
def test_the_plot_of_events_has_a_dot_for_every_run(count: int, boxes: int) -> None:
    """Two runs are joined by a line; quartiles say something from five runs on."""
    comparison = compare_runs(dict(reversed([*_runs(count).items()])))
    plot = event_changes(comparison)
    assert {len(row.dots) for row in plot.rows} == {count} == {len(plot.legend)}
    assert len({kind for kind, _ in plot.legend}) == count
    root = parsed_inside(drawn(plot))
    assert len([*root.iter(f"{SVG}circle")]) == count * 8 + count  # and those of the legend
    assert len([*root.iter(f"{SVG}rect")]) == boxes == sum(row.box is not None for row in plot.rows)
    first, second = (run.by_event for run in comparison.runs[:2])
    worse = sum((second[event].value or 0) < (first[event].value or 0) for event in first)
    assert worse
    lost = [row for row in plot.rows if row.span is not None and row.span[2] == "loss"]
    assert len(lost) == (worse if count == 2 else 0)


def test_the_quartiles_are_over_the_runs() -> None:
    for event, over_runs in plain(THREE)["events"].items():
        changes = sorted(run["by_event"][event]["value"] for run in plain(THREE)["runs"])
        assert [over_runs[key] for key in ("lowest", "median", "highest")] == changes
        assert over_runs["lower_quartile"] == pytest.approx((changes[0] + changes[1]) / 2)
        assert over_runs["upper_quartile"] == pytest.approx((changes[1] + changes[2]) / 2)


def test_the_figure_of_outcomes_has_bars_as_long_as_the_shares() -> None:
    root = parsed_inside(drawn(outcome_shares(THREE)))
    bars = [float(bar.attrib["width"]) for bar in root.iter(f"{SVG}rect")][4:]
    assert len(bars) == 3 * 4
    for run, start in zip(plain(THREE)["runs"], range(0, 12, 4), strict=True):
        whole = sum(bars[start : start + 4])
        shares = [bar / whole for bar in bars[start : start + 4]]
        counts = ["preserved_success", "change_associated_success", "regression", "persistent_failure"]
        assert shares == pytest.approx([run["outcomes"][key] / 32 for key in counts], abs=1e-3)


def test_a_comparison_is_written_as_pages_with_their_figures(tmp_path: Path) -> None:
    names = {path.name for path in write_comparison(THREE, tmp_path / "new")}
    assert {"comparison.json", "comparison.md", "comparison.html", "event-changes.svg"} <= names
    assert all((tmp_path / "new" / name).stat().st_size for name in names)
    page = comparison_markdown(THREE)
    for link in re.findall(r"\]\((\S+)\)", page):
        assert link in names
    for statement in STATEMENTS.values():
        assert statement in page
        assert escape(statement) in comparison_html(THREE)


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ReportError, match=r"Cannot make .*file/new"):
        write_comparison(THREE, tmp_path / "file" / "new")


def test_the_page_of_a_comparison_needs_no_network_and_escapes_names() -> None:
    page = comparison_html(THREE)
    assert page.count("<svg") == page.count("</svg>") == 1 + len(THREE.events)
    assert not re.search(r"<script|<link|url\(|src=|<co>", page)


def test_the_page_of_a_comparison_has_every_case_with_what_became_of_it_in_every_run(tmp_path: Path) -> None:
    runs = {str(tmp_path / f"run{k}"): run for k, run in enumerate(_runs(2).values())}
    item = PAIRS[2].item_id
    for path, run in zip(map(Path, runs), runs.values(), strict=True):
        write_run(path, run)
        (path / "films").mkdir()
        (path / "films" / f"{item}--base dynamic.mp4").touch()
    (tmp_path / "run1" / "report.html").touch()
    page = comparison_html(compare_runs(runs), common_cases(runs), tmp_path / "page")
    data = page_cases(page)
    assert {*data["items"]} == {pair.item_id for pair in PAIRS}
    (last,) = (column for column in data["columns"] if column["title"] == "run1")
    assert last["at"] == sorted(last["at"]), "the cases that the last run loses come first"
    columns = {column["title"]: column for column in data["columns"]}
    outcomes = {
        name: dict(zip(data["items"], (column["labels"][place] for place in column["at"]), strict=True))
        for name, column in columns.items()
        if name in ("run0", "run1", "Changed")
    }
    assert [outcomes[name][item] for name in ("run0", "run1", "Changed")] == [
        "regression",
        "preserved_success",
        "yes",
    ]
    flips = {flip["item_id"] for flip in plain(compare_runs(runs))["flips"]}
    assert {name for name, changed in outcomes["Changed"].items() if changed == "yes"} == flips
    place = str(data["items"].index(item))
    assert data["films"][place] == [
        [f"run{k}", f"../run{k}/films/{item}--base%20dynamic.mp4"] for k in (0, 1)
    ]
    timeline = data["details"][int(place)]["timeline"]
    kinds = {name: arm["kind"] for name, arm in timeline["arms"].items()}
    both = {"base": "arm0", "dynamic": "arm1"}
    assert kinds == {f"run{k}, {arm}": kind for k in (0, 1) for arm, kind in both.items()}
    assert timeline["steps"] == max(arm["end"] for arm in timeline["arms"].values())
    assert timeline["arms"]["run0, dynamic"]["success"] is False
    assert data["pages"] == [["run1", "../run1/report.html"]]
    assert data["start"] == {"changed": "yes"}
    assert data["details"][int(place)]["tables"]["Runs"]["run0"]["outcome"] == "regression"


def test_a_comparison_in_which_nothing_changed_shows_all_cases() -> None:
    stored = next(iter(_runs(1).values()))
    runs = {"a": stored, "b": stored}
    page = comparison_html(compare_runs(runs), common_cases(runs))
    assert page_cases(page)["start"] == {}
