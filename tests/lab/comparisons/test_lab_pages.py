"""Pages of runs in their order and of published runs, as those of a run and of a comparison are tested."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.cli import main
from pytest_libero_max.lab.comparisons.paper_files import write_tables
from pytest_libero_max.lab.comparisons.trend import trend_html
from pytest_libero_max.lab.index.index_page import index_html
from pytest_libero_max.lab.index.run_index import IndexedRun, RunIndex
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.publication import About
from pytest_libero_max.report.stopping_rule import BIAS
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import StoredRun
from tests.report.comparison.test_compare import ALWAYS, MIXED, run_of
from tests.report.made_up import PROVENANCE, plan, record_of
from tests.report.page.browser import Shown
from tests.report.page.test_accessibility import axe, browser, complaints
from tests.report.test_one_of_each import texts_of_study, words, wrong_numbers

__all__ = ["axe", "browser"]

NO_CAUSES: Any = [Counter(), Counter()]


def _stopped() -> StoredRun:
    whole = run_of(MIXED)
    stop = Stopped("losses and gains are not equally likely", 32, "anytime:0.05", 30)
    return StoredRun(whole.run, whole.records[:30], (), torn=False, stopped=stop)


def test_a_stopped_run_has_no_interval_and_is_called_so(tmp_path: Path) -> None:
    runs = {"old": run_of(ALWAYS), "stopped": _stopped()}
    page = trend_html(compare_runs(runs, restrict=True), NO_CAUSES)
    assert "anytime:0.05 at pair 30" in page
    assert f"stopped: {BIAS}" in page
    assert "rule stopped one" in page
    outcomes = {name: RunOutcomes.of(run) for name, run in runs.items()}
    write_tables(outcomes, tmp_path, restrict=True)
    (row,) = [line for line in (tmp_path / "main.csv").read_text().splitlines() if "stopped" in line]
    assert ",," in row


def test_warnings_and_notes_of_a_run_stand_beside_its_numbers() -> None:
    noisy = run_of(ALWAYS)
    records = [structs.replace(one, policy={**one.policy, "repeatable": False}) for one in noisy.records]
    runs = {"fails": run_of([(False, False)] * 32), "noisy": StoredRun(noisy.run, tuple(records), (), False)}
    page = trend_html(compare_runs(runs), NO_CAUSES)
    assert "Base solves 0" in page
    assert "32 pairs of noisy" in page


def test_one_pair_is_no_pairs() -> None:
    (pair, *_) = plan()
    record = record_of(pair, True, False)
    report = build_report([record], [], [pair], PROVENANCE)
    runs = {name: StoredRun(Run((pair,), PROVENANCE), (record,), (), torn=False) for name in ("a", "b")}
    index = RunIndex({"cases": [IndexedRun(Path("a"), report, "0" * 64, "MuJoCo", True, About(), None)]}, [])
    pages = [trend_html(compare_runs(runs), NO_CAUSES), index_html(index, Path())]
    assert wrong_numbers(map(words, pages)) == []
    assert wrong_numbers(texts_of_study("camera-timing")) == []


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", ["trend", "index"])
def test_axe_finds_nothing(browser: Any, axe: str, tmp_path: Path, name: str, dark: bool) -> None:
    comparison = compare_runs({"old": run_of(ALWAYS), "new": run_of(MIXED)})
    text = (
        trend_html(comparison, [Counter(), Counter(missed_moved_goal=2)])
        if name == "trend"
        else index_html(RunIndex({}, []), tmp_path)
    )
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    assert complaints(Shown(browser, tmp_path / "page.html", "", dark=dark, table=False), axe) == []


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (["--by-cell", "--over-time"], ["--by-cell", "--over-time"]),
        (["--csv=a.csv"], ["--csv", "--over-time"]),
        (["--published"], ["--published", "--tables"]),
        (
            ["--over-time", "--json=a.json", "--output=b"],
            ["--over-time", "--json, --output", "--restrict, --csv"],
        ),
        (["--by-cell", "--restrict"], ["--by-cell", "--restrict", "it takes --json."]),
    ],
)
def test_options_that_do_not_belong_together_are_refused(
    options: list[str], names: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", "a", "b", *options]) == 1
    error = capsys.readouterr().err
    assert [name for name in names if name not in error] == []
