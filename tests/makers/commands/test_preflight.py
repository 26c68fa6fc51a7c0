from __future__ import annotations

from collections.abc import Sequence

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.cli import main
from pytest_libero_max.makers.construction.examiner import Examiner
from pytest_libero_max.makers.construction.preflight import Preflight, Problem


def test_the_preflight_of_a_manifest_is_printed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def examine(self: Examiner, cases: Sequence[Case]) -> dict[str, Preflight]:
        problems = ((), (Problem("view", "a cup has 3 pixels"),))
        return {case.case_id: Preflight(some) for case, some in zip(cases, problems, strict=True)}

    monkeypatch.setattr(Examiner, "examine", examine)
    assert main(["dev", "preflight", "smoke", "--limit", "2"]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("1 of 2 ")
    assert lines[-1].endswith(": a cup has 3 pixels")
