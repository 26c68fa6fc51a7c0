"""Lines on standard output, for every command that prints names from files."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence

from pytest_libero_max.benchmark.documents import printable


def say(lines: Iterable[str]) -> None:
    """Print lines; what would steer the terminal is spelled."""
    print("\n".join(map(printable, lines)), flush=True)


def say_coloured(lines: Sequence[str]) -> None:
    """Print lines of a summary: in colours on a terminal, unless ``NO_COLOR`` is set."""
    from pytest_libero_max.report.broken import coloured

    print(coloured(lines, sys.stdout.isatty() and not os.environ.get("NO_COLOR")))
