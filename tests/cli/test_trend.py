"""``libero-max trend``: runs in their order, over the cases that all have measured."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pytest_libero_max.cli import main

REPORTS = Path(__file__).parents[2] / "reports"
RUNS = [str(REPORTS / "smoke" / name) for name in ("stale_expert", "expert")]


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_each_run_has_a_line_with_its_rates_and_causes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {"csv": tmp_path / "trend.csv", "figure": tmp_path / "trend.svg"}
    assert main(["trend", *RUNS, *(f"--{name}={file}" for name, file in files.items())]) == 0
    first, head, *rows = capsys.readouterr().out.splitlines()
    assert first == "2 runs on 32 common cases"
    assert head.startswith("run ")
    assert [row.split()[0] for row in rows] == ["stale_expert", "expert"]
    assert "-28.1 [-46.7, -7.3]" in rows[0]
    assert "9/27  not_recorded 9" in rows[0]
    with files["csv"].open(newline="") as file:
        stale, expert = csv.DictReader(file)
    assert (stale["paired_change"], stale["lost"], stale["of"]) == ("-0.28125", "9", "27")
    assert (expert["run"], expert["dynamic_success"], expert["lost"]) == ("expert", "1.0", "0")
    words = [shape.text for shape in ElementTree.parse(files["figure"]).iter() if shape.tag.endswith("text")]
    assert {"Success on 32 common cases", "stale_expert", "expert"} <= set(words)


def test_one_run_is_no_trend(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trend", RUNS[0]]) != 0
    assert "two or more runs" in capsys.readouterr().err
