"""Figures in prose that were measured or counted elsewhere: each page says what its source says."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.store import read_pairs
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.significance import WORDS
from pytest_libero_max.substrates.libero.lacking import lacking_own

ROOT = Path(__file__).parents[1]


def _number(page: str, pattern: str) -> float:
    found = re.findall(pattern, (ROOT / page).read_text())
    assert len(found) == 1, f"{page}: {pattern} is there {len(found)} times"
    return float(found[0].replace(",", ""))


@pytest.mark.parametrize(
    ("page", "says", "source", "measured", "tolerance"),
    [
        pytest.param(
            "README.md",
            r"in (\d+) seconds on two idle cores",
            "reports/cost.md",
            r"as it is, three times by turns \| .* s \| [\d.]+, ([\d.]+), [\d.]+ s",
            1.0,
            id="smoke",
        ),
        pytest.param(
            "CONTRIBUTING.md",
            r"in (\d+) minutes on two busy cores",
            "reports/construction.md",
            r"in (\d+) minutes on two\ncores that were also used",
            0.0,
            id="build",
        ),
        pytest.param(
            "docs/explanation/scenes.md",
            r"\[2\.1 to ([\d.]+) GiB of memory\]",
            "reports/genuine/README.md",
            r"takes 2\.1 to ([\d.]+) GiB",
            0.0,
            id="worker of genuine scenes",
        ),
        pytest.param(
            "docs/explanation/scenes.md",
            r"\[[\d.]+ to ([\d.]+) GiB of memory\]",
            "pytest_libero_max/substrates/libero/kind.py",
            r"worker_gib=([\d.]+)",
            0.0,
            id="worker that doctor counts with",
        ),
    ],
)
def test_a_page_says_what_was_measured(
    page: str, says: str, source: str, measured: str, tolerance: float
) -> None:
    assert _number(page, says) == pytest.approx(_number(source, measured), abs=tolerance)


@pytest.mark.parametrize(
    ("track", "words"), [("smoke", "of `smoke`"), ("lite", "of `lite` and"), ("max", "of `max`.")]
)
def test_a_page_counts_what_plays_with_own_source_variations(track: str, words: str) -> None:
    cases = load_track(track).cases
    play = _number("docs/explanation/scenes.md", rf"at\nreset alone: .*?([\d,]+) {re.escape(words)}")
    assert len(cases) - len(lacking_own(cases)) == play


def test_the_readme_shows_the_output_of_the_published_run() -> None:
    stored = read_pairs(ROOT / "reports" / "smoke" / "stale_expert")
    said = summary_lines(report_of(stored), [])
    _, _, printed = (ROOT / "README.md").read_text().partition("== libero-max ==")
    output, _, _ = printed.partition("\nWritten")
    shown = [line for line in output.splitlines()[1:] if line not in ("", "...")]
    assert len(shown) > 15
    assert [line for line in shown if line not in said] == []


def test_the_page_of_numbers_explains_every_verdict() -> None:
    page = (ROOT / "docs" / "explanation" / "numbers.md").read_text(encoding="utf-8")
    assert [word for word in WORDS if f"| {word} | " not in page] == []


def test_the_page_of_recoveries_says_what_its_outcomes_say() -> None:
    page = (ROOT / "reports/learned/recoveries.md").read_text(encoding="utf-8")
    with (ROOT / "reports/learned/recoveries.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    columns = [name for name in rows[0] if name != "pair"]
    assert len(rows) == 80
    for name in (name for name in columns if name.startswith("without")):
        _, seed, arm = re.split("[- ]", name)
        pairs = [(row[name] == "1", row[f"with-{seed} {arm}"] == "1") for row in rows]
        before, after = (sum(column) for column in zip(*pairs, strict=True))
        lost, gained = pairs.count((True, False)), pairs.count((False, True))
        interval = paired_difference(lost, gained, len(pairs))
        assert interval is not None
        ends = f"[{100 * interval.lower:+.1f}, {100 * interval.upper:+.1f}]"
        change = f"{100 * (after - before) / len(pairs):+.1f} pp {ends}"
        cells = f"| {before} | {after} | {lost} | {gained} | {change} |"
        assert re.search(rf"^\| {arm.title()}.* {re.escape(cells)}$", page, re.M), (name, cells)
    for event in BENCHMARK_EVENTS:
        own = [row for row in rows if row["pair"].split("-")[-2] == event]
        counts = [sum(row[name] == "1" for row in own) for name in columns]
        assert f"| {event} | {' | '.join(map(str, counts))} |" in page
