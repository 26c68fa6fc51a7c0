"""Tests for before a commit: those of all functions but the slow ones, which ``slow_tests.txt`` lists.

``python -m tests.quick FILE`` reads the durations of a whole run from its JUnit file and fails where the
quick tests take too long; ``--write`` lists the slow functions again. A new test is quick until then.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

LIST = Path(__file__).with_name("slow_tests.txt")
SLOW_S = 0.3
"""Mean duration of a slow function's tests."""

LIMIT_S = 540.0
"""Duration of all quick tests together: three minutes on three workers."""


@cache
def slow_functions() -> frozenset[str]:
    """Return the listed functions, as ``tests/test_x.py::test_y``."""
    return frozenset(LIST.read_text(encoding="utf-8").split())


def durations(file: Path) -> dict[str, list[float]]:
    """Return the duration of each test in a JUnit file in s, by function."""
    by_function: dict[str, list[float]] = defaultdict(list)
    for case in ElementTree.parse(file).getroot().iter("testcase"):
        module = str(case.get("classname")).replace(".", "/")
        function = str(case.get("name")).partition("[")[0]
        by_function[f"{module}.py::{function}"].append(float(case.get("time", 0)))
    return by_function


def slow_of(times: dict[str, list[float]]) -> list[str]:
    """Return the functions that the list should have."""
    return sorted(name for name, each in times.items() if sum(each) / len(each) >= SLOW_S)


def main(words: list[str]) -> int:
    """Judge or write the list.

    Returns:
        0, or 1 where the quick tests take more than ``LIMIT_S``.
    """
    parser = argparse.ArgumentParser(prog="python -m tests.quick", description=__doc__)
    parser.add_argument("junit", type=Path, help="of a run of all tests")
    parser.add_argument("--write", action="store_true", help="write the list of slow functions")
    arguments = parser.parse_args(words)
    times = durations(arguments.junit)
    if arguments.write:
        LIST.write_text("".join(f"{name}\n" for name in slow_of(times)), encoding="utf-8")
        slow_functions.cache_clear()
    quick = [each for name, each in times.items() if name not in slow_functions()]
    seconds = sum(map(sum, quick))
    print(
        f"pytest -m quick: {sum(map(len, quick))} tests, {seconds:.0f} s together of at most {LIMIT_S:.0f} s."
    )
    return int(seconds > LIMIT_S)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
