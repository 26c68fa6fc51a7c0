"""Verdicts on gates as lines of the terminal, and as annotations of GitHub."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gates import SUCCESS_OF, Finding, GateResult, shown
from pytest_libero_max.runs.replay_command import replay_text

_NAMED = 3


class GateRow(NamedTuple):
    """A verdict as reports show it."""

    gate: str
    finding: Finding
    value: str
    """Value of its quantity, in the unit of the gate."""
    why: str
    """What else explains the verdict; empty where the value does."""
    lost: Sequence[str]


def gate_rows(results: Iterable[GateResult]) -> list[GateRow]:
    """Return a row for each gate, for the page and the Markdown of a report."""
    rows = []
    for result in results:
        value, why = "n/a", result.detail
        if result.value is not None:  # which the detail begins with, and with the verdict after it
            value, why = shown(result.gate, result.value), why.partition(". ")[2].partition(": ")[2]
        why = f"{why[:1].upper()}{why[1:]} {result.differences}".strip()
        rows.append(GateRow(result.gate.text, result.finding, value, why, result.lost))
    return rows


def named_pairs(names: Sequence[str]) -> str:
    """Return the first pairs by name, and the number of the others."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{', '.join(names[:_NAMED])}{more}"


_LOST, _FAILED, _AGAIN, _SEE = "  lost:", "  failed:", "  again:", "  see:"

KEPT = ("gate FAIL", "gate open", "gate wait", "gate first", _LOST, _FAILED, _AGAIN, _SEE)
"""Beginnings of the lines on gates that ``-q`` keeps."""


def gate_lines(
    results: Sequence[GateResult], replay: Sequence[str] | None = None, show: str | None = None
) -> list[str]:
    """Return the lines on gates for the terminal, with the pairs that count against one that fails.

    A command that shows them takes the place of the one that plays them again.
    """
    marks = {"passed": "pass", "failed": "FAIL", "undecidable": "open"}
    lines = []
    for result in results:
        mark = "first" if result.no_baseline else "wait " if result.waits else f"{marks[result.verdict]} "
        lines.append(f"gate {mark} {result.reason}")
        if result.lost:
            label = _FAILED if result.gate.name in SUCCESS_OF else _LOST
            lines.append(f"{label} {named_pairs(result.lost)}")
    lost = next((result.lost[0] for result in results if result.lost), None)
    if show is not None and lost is not None:
        lines.append(f"{_SEE} {show}")
    elif replay is not None and lost is not None:
        lines.append(f"{_AGAIN} {replay_text(replay, lost)}")
    return lines


def not_passed_text(results: Sequence[GateResult]) -> str | None:
    """Return the sentence on gates that did not pass, such as ``1 of 2 gates failed.``; None if all did."""
    counts: Counter[str] = Counter(result.verdict for result in results)
    said = {"failed": "failed", "undecidable": "cannot be decided"}
    words = [
        f"{counts[verdict]} of {counted(len(results), 'gate')} {word}"
        for verdict, word in said.items()
        if counts[verdict]
    ]
    return f"{', '.join(words)}." if words else None


def github_annotations(results: Sequence[GateResult]) -> list[str]:
    """Workflow commands that show gates on a GitHub run which did not pass or had no other run."""
    errors = [
        f"::error title=LIBERO-MAX gate {result.verdict}::{_escaped(result.reason)}"
        for result in results
        if not (result.passed or result.waits)
    ]
    notices = [
        f"::notice title=LIBERO-MAX gate without a baseline::{_escaped(result.reason)}"
        for result in results
        if result.no_baseline
    ]
    return [*errors, *notices]


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
