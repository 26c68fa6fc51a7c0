"""The page of an examination."""

from __future__ import annotations

import re
from collections.abc import Iterator

from pytest_libero_max.conformance.results import RuleResult, conformance, installed_versions
from pytest_libero_max.conformance.rules import Finding, Outcome, Rule, broken, kept, unexamined
from pytest_libero_max.report.page.conformance_page import conformance_document, conformance_html


def _nothing(subject: object) -> Iterator[Finding]:
    """Keep a <rule>."""
    yield kept()


def _results() -> dict[str, RuleResult]:
    outcomes = (
        Outcome(Rule("env/a/kept", "must", _nothing), (kept("as it was"),)),
        Outcome(Rule("env/a/doubtful", "should", _nothing), (broken("two", "one", "Divide."),)),
        Outcome(Rule("env/a/wrong", "must", _nothing), (broken("<three>", "one", "Divide.", part="camera"),)),
        Outcome(Rule("env/a/unseen", "must", _nothing), (unexamined("no clock"),)),
    )
    return {outcome.rule.id: RuleResult.of(outcome) for outcome in outcomes}


def test_broken_rules_come_first_by_level() -> None:
    results = _results()
    document = conformance_document(conformance("env:a:b", results, [*results, "env/a/left-out"]))
    titles = [section.title for section in document.sections]
    assert [re.findall("must|should|Not examined|Kept|Not run", title) for title in titles] == [
        ["must"],
        ["should"],
        ["Not examined"],
        ["Kept"],
        ["Not run"],
    ]
    (row,) = document.sections[0].tables[0].rows
    assert row == ("env/a/wrong", "camera <three>", "one", "Divide.")
    assert installed_versions()["mujoco"] in document.texts[1]


def test_the_page_escapes_what_subjects_say() -> None:
    results = _results()
    page = conformance_html(conformance("env:a:b", results, results))
    assert "&lt;three&gt;" in page
    assert "<three>" not in page
