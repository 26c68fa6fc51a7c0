from __future__ import annotations

import pytest

from pytest_libero_max.cli import main


def test_what_can_host_which_event_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eligibility"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1 + 7 + 1 + 10 + 1
    assert lines[1].split()[2:] == ["1076"] * 5 + ["888", "707", "296", "883"]
