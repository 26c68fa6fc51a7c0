"""One run after another: the comparison with an earlier one at the end."""

from __future__ import annotations

from collections.abc import Callable

import pytest

Run = Callable[..., pytest.RunResult]


def test_a_run_is_compared_with_the_same_part_of_a_named_one_where_there_is_one(run: Run) -> None:
    run("-k", "camera_shift or target_relocation", "--libero-max-output=first")
    result = run("-k", "camera_shift", "--libero-max-output=second", "--libero-max-compare=first")
    result.stdout.fnmatch_lines(
        [
            "second (reacher) against first (reacher), on 2 common cases",
            "Dynamic success, contrasts",
            "No case changed.",
            "More: libero-max compare --restrict first second",
        ]
    )
    result = run("-k", "target_relocation", "--libero-max-compare=second")
    assert result.ret == 0
    result.stdout.fnmatch_lines(["No comparison with second: The runs have no measured case in common*"])
