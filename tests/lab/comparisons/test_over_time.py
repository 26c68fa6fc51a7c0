"""``libero-max compare --over-time``: runs in their order, over the cases that all have measured."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pytest_libero_max.cli import main

REPORTS = Path(__file__).parents[3] / "reports"
RUNS = [str(REPORTS / "smoke" / name) for name in ("stale_expert", "expert")]


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_each_run_has_a_line_with_its_rates_and_causes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {name: tmp_path / f"trend.{name}" for name in ("csv", "figure", "html")}
    assert main(["compare", "--over-time", *RUNS, *(f"--{name}={file}" for name, file in files.items())]) == 0
    first, _, head, *rows = capsys.readouterr().out.splitlines()
    assert first.startswith("Trend of 2 runs")
    assert head.startswith("Run ")
    assert [row.split()[0] for row in rows] == ["stale_expert", "expert"]
    assert "-28.1 pp [-46.7, -7.3]" in rows[0]
    assert "9/27  missed_moved_goal 4, missed_moved_target 4, grasp_slipped 1" in rows[0]
    with files["csv"].open(newline="") as file:
        stale, expert = csv.DictReader(file)
    assert (stale["paired_change"], stale["regression"], stale["preserved_success"]) == (
        "-0.28125",
        "9",
        "18",
    )
    assert (expert["Run"], expert["dynamic_success"], expert["regression"]) == ("expert", "1.0", "0")
    words = [shape.text for shape in ElementTree.parse(files["figure"]).iter() if shape.tag.endswith("text")]
    assert {"1 stale_expert", "2 expert"} <= set(words)
    page = files["html"].read_text()
    assert "<title>Trend of 2 " in page
    assert not re.search(r"<script|<link|url\(|src=", page)
    row = "<th scope='row'>1 stale_expert</th><td data-title='Base success'>84.4% [67.2, 94.7]"
    assert row in page
    assert re.search(r"data-title='Base successes lost'>[^<]* 9/27<", page)
    assert "1 stale_expert</th><td data-title='missed moved goal'>4</td>" in page


def test_one_run_is_no_trend(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "--over-time", RUNS[0]]) != 0
    assert "two or more" in capsys.readouterr().err
