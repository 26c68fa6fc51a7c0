"""Lines on standard output, for every command that prints names from files."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_libero_max.benchmark.documents import printable


def say(lines: Iterable[str]) -> None:
    """Print lines; what would steer the terminal is spelled."""
    print("\n".join(map(printable, lines)), flush=True)
