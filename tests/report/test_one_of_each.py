"""Texts on one run of one pair of one case: no number is followed by a noun in the wrong number."""

from __future__ import annotations

import re
from collections.abc import Iterable

import pytest

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.comparison.compare_files import comparison_html, comparison_markdown
from pytest_libero_max.report.comparison.comparison_sections import comparison_lines, short_lines
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.summary import quiet_lines, summary_lines
from tests.report.made_up import PROVENANCE, plan, record_of, run_of
from tests.report.studies.studied import cell, study_of

_WRONG = re.compile(
    r"(?<![\w.,/%+-])(?<!of )1 (?:common |published |planned |other |source )?"
    r"(?:arms|cases|categories|events|games|groups|pairs|plays|regressions|runs|seeds|steps|suites|tasks)\b"
)


def words(text: str) -> str:
    """The text that people see of a page."""
    return re.sub(r"<(script|style)\b.*?</\1>|<[^>]*>", " ", text, flags=re.S)


def wrong_numbers(texts: Iterable[str]) -> list[str]:
    """Places where a 1 is followed by several."""
    return [
        text[max(0, place.start() - 60) : place.end() + 30]
        for text in texts
        for place in _WRONG.finditer(text)
    ]


@pytest.mark.parametrize(("base", "dynamic"), [(True, False), (False, True), (True, True)])
def test_a_run_of_one_pair(base: bool, dynamic: bool) -> None:
    (pair, *_) = plan()
    record = record_of(pair, base, dynamic)
    report = build_report([record], [], [pair], PROVENANCE)
    comparison = compare_runs({name: run_of([pair], [record]) for name in ("a", "b")})
    texts = [
        markdown(report),
        words(html(report, [], ["pytest"])),
        *(" ".join(lines(report)) for lines in (summary_lines, quiet_lines)),
        *(" ".join(lines(comparison)) for lines in (comparison_lines, short_lines)),
        comparison_markdown(comparison),
        words(comparison_html(comparison)),
    ]
    assert wrong_numbers(texts) == []


def test_a_study_of_one_case() -> None:
    assert wrong_numbers(texts_of_study("event-timing")) == []


def texts_of_study(name: str) -> list[str]:
    """What is printed of a study of one case."""
    planned, records, provenance = study_of([cell("plus", "101", 1)], {"name": name})
    report = build_report(records, [], planned, provenance)
    return [markdown(report), " ".join(summary_lines(report)), words(html(report, [], ["pytest"]))]
