"""Verdicts on gates as lines of the terminal, and as annotations of GitHub."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.gate_rows import named_pairs
from pytest_libero_max.report.gates import SUCCESS_OF, GateResult
from pytest_libero_max.runs.replay_command import replay_text

_LOST, _FAILED, _AGAIN, _SEE = "  lost:", "  failed:", "  again:", "  see:"

KEPT = ("gate FAIL", "gate open", "gate wait", "gate first", _LOST, _FAILED, _AGAIN, _SEE)
"""Beginnings of the lines on gates that ``-q`` keeps."""


def gate_lines(
    results: Sequence[GateResult], replay: Sequence[str] | None = None, show: str | None = None
) -> list[str]:
    """Return the lines on gates for the terminal: one each, and the pairs that count against one that fails.

    Args:
        replay: Result of :func:`~pytest_libero_max.runs.replay_command.replay_command`; None leaves it out.
        show: Result of :func:`~pytest_libero_max.runs.media.show_command`, which takes its place.
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
