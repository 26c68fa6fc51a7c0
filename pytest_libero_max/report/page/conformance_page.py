"""The page of an examination: broken rules first, with what was observed, what was expected and a cure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pytest_libero_max.conformance.lines import summary_lines
from pytest_libero_max.conformance.results import Conformance, FindingResult, RuleResult
from pytest_libero_max.report.document import Code, Document, Section, Table
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.page.page_frame import document_page

CONFORMANCE_PAGE_NAME = "conformance.html"

_LEVELS = {
    "must": "These give wrong results.",
    "should": "Mistakes in most subjects, and intended in few.",
    "note": "These may be intended.",
}


def conformance_html(document: Conformance) -> str:
    """Render an examination as a page."""
    return document_page("document.html", conformance_document(document))


def conformance_document(document: Conformance) -> Document:
    """Return an examination as a document."""
    versions = ", ".join(f"{name} {version}" for name, version in document.versions.items())
    texts = [summary_lines(document)[0], f"Examined with pytest-libero-max {document.package}, {versions}."]
    return Document(document.subject, texts=texts, sections=[*_sections(document)])


def _sections(document: Conformance) -> Iterator[Section]:
    for level, lead in _LEVELS.items():
        rules = [rule for rule in document.rules if rule.state == "broken" and rule.level == level]
        if rules:
            title = f"{counted(len(rules), 'rule')} of level {level} broken"
            head = ("Rule", "Observed", "Expected", "Cure")
            yield Section(title, [Table("", head, [*_rows(rules, "broken")])], lead=lead)
    for state, title in (("unexamined", "Not examined"), ("kept", "Kept")):
        rules = [rule for rule in document.rules if rule.state == state]
        if rules:
            columns = ("Rule", "Reason" if state == "unexamined" else "Observed")
            rows = [row[:2] for row in _rows(rules, state)]
            yield Section(f"{title}: {counted(len(rules), 'rule')}", [Table("", columns, rows)], folded=True)
    if document.not_run:
        yield Section(
            f"Not run: {counted(len(document.not_run), 'rule')}", items=document.not_run, folded=True
        )


def _rows(rules: Iterable[RuleResult], state: str) -> Iterator[tuple[str, ...]]:
    for rule in rules:
        for finding in rule.findings:
            if finding.state == state:
                yield Code(rule.id), _observed(finding, rule), finding.expected, finding.cure


def _observed(finding: FindingResult, rule: RuleResult) -> str:
    text = f"{finding.part} {finding.observed}".strip()
    return f"{text} [expected: {rule.expected_to_break}]" if rule.expected_to_break else text
