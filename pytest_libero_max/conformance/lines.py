"""Outcomes as lines for people."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from pytest_libero_max.conformance.results import Conformance
from pytest_libero_max.conformance.rules import Finding, Outcome
from pytest_libero_max.errors import counted

STRICT = "--strict"
"""Option of ``libero-max check`` that counts as wrong what breaks a rule of level ``should``."""


Word = Literal["ok", "wrong", "note", "skip"]


class CheckLine(NamedTuple):
    """A finding as ``libero-max check`` prints it."""

    word: Word
    text: str
    doubtful: bool
    """True for a note that ``--strict`` counts as wrong."""

    def __str__(self) -> str:
        return f"{self.word:<6}{self.text}{f' [{STRICT}: wrong]' if self.doubtful else ''}"


def check_lines(outcomes: Sequence[Outcome], *, strict: bool = False) -> list[CheckLine]:
    """Return a line for each finding; one for those that say the same of the same part."""
    lines: dict[str, CheckLine] = {}
    for outcome in outcomes:
        level, name = outcome.rule.level, outcome.rule.id.partition("/")[2]
        broken: Word = "wrong" if level == "must" or (strict and level == "should") else "note"
        words: dict[str, Word] = {"kept": "ok", "unexamined": "skip", "broken": broken}
        for finding in outcome.findings:
            word, text = words[finding.state], _text(finding)
            part = f", {finding.part}" if finding.part else ""
            line = CheckLine(word, f"{name}{part}: {text}", word == "note" and level == "should")
            lines.setdefault(f"{finding.part} {text}", line)
    return [*lines.values()]


def _text(finding: Finding) -> str:
    text = finding.observed
    if finding.expected:
        text += f"; expected: {finding.expected}"
    return f"{text}. {finding.cure}" if finding.cure else text


def message(outcome: Outcome, subject: str, options: Sequence[str] = ()) -> str:
    """Return everything that a reader needs of a broken rule: observed, expected, cure, command."""
    return "\n".join(_message(outcome, subject, options))


def _message(outcome: Outcome, subject: str, options: Sequence[str]) -> Iterator[str]:
    rule = outcome.rule
    yield f"{subject} breaks {rule.id} ({rule.level}): {rule.title}."
    for finding in outcome.broken:
        part = f"{finding.part} " if finding.part else ""
        yield f"  observed: {part}{finding.observed}"
        yield f"  expected: {finding.expected}"
        yield f"  cure:     {finding.cure}"
    choice = ("-k", f"{rule.area} and {rule.id.split('/')[2]}")
    yield f"Again: {shlex.join(('pytest', f'--libero-max-conform={subject}', *options, *choice))}"


def summary_lines(document: Conformance) -> list[str]:
    """Return the verdict on a subject, and a line for each rule that is broken."""
    counts = document.counts
    examined = len(document.rules) - counts["unexamined"]
    verdict = {True: "conforms", False: "does not conform", None: "was examined in part"}[document.conforms]
    lines = [
        f"{document.subject} {verdict}: {counts['kept']} kept of {counted(examined, 'rule')} that could be "
        "examined"
    ]
    if document.not_run:
        total = len(document.rules) + len(document.not_run)
        lines.append(f"{len(document.not_run)} of {counted(total, 'rule')} were not run")
    for rule in document.rules:
        for finding in rule.findings:
            if finding.state == "broken":
                part = f"{finding.part} " if finding.part else ""
                expected = f" [expected: {rule.expected_to_break}]" if rule.expected_to_break else ""
                lines.append(f"{rule.level:<6} {rule.id}: {part}{finding.observed}{expected}")
    if counts["unexamined"]:
        lines.append(f"{counted(counts['unexamined'], 'rule')} could not be examined; -rs says why.")
    return lines
