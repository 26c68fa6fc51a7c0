"""Outputs in pages: the terminal's summary of a published run, computed from its pairs.

A block of a page that begins with a command and has the heading of the summary is filled with an excerpt.
"""

from __future__ import annotations

import re
from pathlib import Path

from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.store import read_pairs

RUN = "reports/smoke/stale_expert"
"""The run that the pages show."""

HEADING = "== libero-max =="

_BLOCK = re.compile(rf"(^\$ pytest [^\n]*\n[^`]*?={{2,}}{HEADING}=*\n).*?(?=^Written: )", re.M | re.S)


def with_excerpts(text: str, root: Path) -> str:
    """Return a page with its blocks filled.

    Args:
        text: The page.
        root: The repository.
    """
    return _BLOCK.sub(lambda block: block[1] + _excerpt(root), text)


def _excerpt(root: Path) -> str:
    """The summary down to the events, those events that lost a case, and the first cause."""
    lines = summary_lines(report_of(read_pairs(root / RUN)), [])
    events = next(index for index, line in enumerate(lines) if re.match(r"Event +Pairs ", line))
    broke = next(index for index, line in enumerate(lines) if line.startswith("What broke"))
    rows = [
        line for line in lines[events + 1 : broke] if line and not re.search(r"\b0/\d+", line.split()[-1])
    ]
    cause = next(index for index, line in enumerate(lines[broke:], broke) if line.startswith("R "))
    shown = [*lines[: events + 1], *rows, "...", "", *lines[broke : cause + 1], "..."]
    return "\n".join(shown) + "\n"
