"""One run after another: numbered output folders, and the comparison with the run before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., pytest.RunResult]

FIRST, SECOND = "libero-max-results-0001", "libero-max-results-0002"
NUMBERED = ("-k", "camera_shift", "--libero-max-output=auto", "--libero-max-compare=last")


def test_folders_are_numbered_and_each_run_is_compared_with_the_one_before(
    run: Run, pytester: pytest.Pytester
) -> None:
    result = run(*NUMBERED)
    result.stdout.fnmatch_lines([f"No comparison: *beside {FIRST}."])
    compared = [
        f"{SECOND} (reacher) against {FIRST} (reacher), on 2 common cases",
        f"*{FIRST} *0.0%*0.0%*",
        "No case changed.",
        f"More: libero-max compare {FIRST} {SECOND}",
    ]
    result = run(*NUMBERED, "-n", "1", subprocess=True)
    assert result.ret == 0
    result.stdout.fnmatch_lines(compared)
    last = Path(SECOND, "pairs.jsonl")
    last.write_bytes(b"".join(last.read_bytes().splitlines(keepends=True)[:2]))
    result = run(*NUMBERED, "--libero-max-resume")
    result.stdout.fnmatch_lines(["*2 of 2 planned pairs played", *compared])
    assert sorted(path.name for path in pytester.path.glob("libero-max-results*")) == [FIRST, SECOND]


def test_a_run_is_compared_with_the_same_part_of_a_named_one_where_there_is_one(run: Run) -> None:
    run("-k", "camera_shift or target_relocation", "--libero-max-output=first")
    result = run("-k", "camera_shift", "--libero-max-output=second", "--libero-max-compare=first")
    result.stdout.fnmatch_lines(
        [
            "second (reacher) against first (reacher), on 2 common cases",
            "More: libero-max compare --restrict first second",
        ]
    )
    result = run("-k", "target_relocation", "--libero-max-output=auto", "--libero-max-compare=last")
    result.stdout.fnmatch_lines([f"No comparison: *beside {FIRST}."])
    result = run("-k", "target_relocation", "--libero-max-compare=second")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["No comparison with second: *"])
