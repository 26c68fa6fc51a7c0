from __future__ import annotations

from collections.abc import Callable

import pytest

from pytest_libero_max.cli import main


def test_power_is_printed_for_expectations_and_for_a_run(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["power", "--base", "0.9", "--change=-0.05"]) == 0
    assert "Pairs needed to resolve a change of -5.0 points" in capsys.readouterr().out
    folder = stored("run", seed=1)
    main(["report", folder])
    assert main(["power", "--run", folder]) == 0
    assert "camera_shift" in capsys.readouterr().out
