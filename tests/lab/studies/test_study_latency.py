"""A latency sweep through the report."""

from __future__ import annotations

import json
from importlib import resources

import jsonschema
import pytest
from msgspec.structs import replace

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.stats.paired_difference import paired_difference
from tests.report.made_up import plain
from tests.report.studies.studied import Cell, study_of


def sweep(counts: dict[str, tuple[int, int]], cases: int) -> Report:
    """The report of a sweep with so many successes in Base and Dynamic, by the end of the arms' names."""
    cells = []
    for number in range(cases):
        success: dict[str, bool] = {}
        for end, (base, dynamic) in counts.items():
            success |= {f"base{end}": number < base, f"dynamic{end}": number < dynamic}
        cells.append(Cell("plus", success, 1))
    ends = ",".join(end.removeprefix("_d") for end in counts if end)
    planned, records, provenance = study_of(cells, {"name": "latency", "settings": ends})
    late = [
        replace(
            record,
            arms={
                name: replace(arm, latency="4steps", held_steps=(arm.steps or 0) // 4)
                if "_d" in name
                else arm
                for name, arm in record.arms.items()
            },
        )
        for record in records
    ]
    return build_report(late, [], planned, provenance)


def test_the_cost_of_a_delay_is_over_the_same_cases() -> None:
    report = plain(sweep({"": (30, 24), "_d8": (20, 6), "_d4": (27, 18)}, 40))
    settings = report["study"]["settings"]
    assert [setting["label"] for setting in settings] == ["d=0 (0 ms)", "d=4 (200 ms)", "d=8 (400 ms)"]
    assert settings[0]["base_cost"] is settings[0]["dynamic_cost"] is None  # the others are less it
    assert [setting["base_cost"]["value"] for setting in settings[1:]] == [-3 / 40, -10 / 40]
    assert [setting["dynamic_cost"]["value"] for setting in settings[1:]] == [-6 / 40, -18 / 40]
    interval = paired_difference(18, 0, 40)
    assert interval is not None
    assert settings[2]["dynamic_cost"]["lower"] == pytest.approx(interval.lower)
    assert settings[0]["held"] == 0.0
    assert 0.2 < settings[1]["held"] <= 0.25


@pytest.mark.parametrize("cases", [0, 1, 3])
def test_every_writer_prints_a_sweep_of_any_size(cases: int) -> None:
    report = sweep({"": (1, 1), "_d2": (1, 0), "_d4sync": (0, 0)}, cases)
    schema = json.loads(
        resources.files("pytest_libero_max.report").joinpath("report.schema.json").read_text()
    )
    jsonschema.Draft202012Validator(schema).validate(plain(report))
    for text in (markdown(report), html(report, [], ["pytest"]), "\n".join(summary_lines(report))):
        assert ("d=4 (200 ms) sync" in text) == bool(cases)
    assert report.study is not None
    assert list(study_figures(report.study)) == (["latency"] if cases else [])
