from __future__ import annotations

import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import Rows
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import SECTIONS, PlayedPairs, ReportSection, with_sections
from pytest_libero_max.report.timing import TITLE, Timing
from tests.report.made_up import PROVENANCE, plain, plan, records_of

PAIRS = plan()
REPORT = build_report([], [], PAIRS, PROVENANCE)


def test_sections_are_added() -> None:
    amended = {**plain(REPORT), "sections": {"Mine": {"a": 1, "b": "text", "c": None, "d": True}}}
    assert plain(with_sections(REPORT, amended)) == amended
    assert plain(REPORT)["sections"] == {}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"overall": {"played": 3}}, "changed overall"),
        ({"overall": {"played": {1, 2}}}, "changed overall"),
        ({"extra": 1}, "changed extra"),
        ({"sections": []}, r"\['sections'\]=\[\]"),
        ({"sections": {"": {}}}, r"\[''\]={}"),
        ({"sections": {"Mine": {"a": [1]}}}, r"'Mine'\]={'a': \[1\]}"),
        ({"sections": {"Mine": {"a": float("nan")}}}, r"'Mine'\]={'a': nan}"),
        ({"sections": {"Mine": {1: "a"}}}, r"'Mine'\]={1: 'a'}"),
    ],
)
def test_nothing_else_may_change(change: dict[str, object], message: str) -> None:
    with pytest.raises(ReportError, match=message):
        with_sections(REPORT, {**plain(REPORT), **change})


def test_nothing_may_be_taken_out() -> None:
    with pytest.raises(ReportError, match="changed base_failures, by, "):
        with_sections(REPORT, {"sections": {}})


def test_computed_rows_stay_as_they_are_and_rows_of_a_hook_are_shown() -> None:
    report = build_report(records_of(PAIRS), [], PAIRS, PROVENANCE)
    sections = plain(report)["sections"]
    added = {"Mine": {"step": 30000}}
    shown = with_sections(report, {**plain(report), "sections": {**sections, **added}})
    assert "## Mine\n\n| Name | Value |\n| --- | --- |\n| step | 30000 |" in markdown(shown)
    rows = sections[TITLE]
    changes: tuple[dict[str, object], ...]
    changes = ({}, {TITLE: {}}, {TITLE: {**rows, "mine": 1}}, {TITLE: {**rows, "Pairs played": 1}})
    for changed in changes:
        with pytest.raises(ReportError, match="under a title"):
            with_sections(report, {**plain(report), "sections": {**changed, **added}})


class Adding(ReportSection):
    """A section of another package."""

    name = "adding"
    title = "Mine"

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        return {self.title.capitalize(): {"pairs": len(played.records) // len(played.tasks)}}


def _report_with(monkeypatch: pytest.MonkeyPatch, section: ReportSection) -> Report:
    monkeypatch.setattr(SECTIONS, "_known", lambda: {"timing": Timing, "adding": lambda: section})
    monkeypatch.setattr(SECTIONS, "_loaded", {})
    return build_report(records_of(PAIRS), [], PAIRS, PROVENANCE)


def test_a_section_is_shown_by_every_writer(monkeypatch: pytest.MonkeyPatch) -> None:
    report = _report_with(monkeypatch, Adding())
    assert report.sections["Mine"] == {"pairs": 1}
    assert "## Mine\n\n| Name | Value |\n| --- | --- |\n| pairs | 1 |" in markdown(report)
    assert "<h2>Mine</h2>" in html(report, [], [])


def test_a_section_that_fails_or_takes_the_title_of_another_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    broken, taking = Adding(), Adding()
    monkeypatch.setattr(broken, "title", None)
    taking.title = TITLE
    for section, words in ((broken, "'adding' failed .AttributeError"), (taking, "which another one has")):
        with pytest.raises(ReportError, match=words):
            _report_with(monkeypatch, section)
