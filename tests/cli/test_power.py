from __future__ import annotations

from collections.abc import Callable

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.report import gate_plan


def test_power_is_printed_for_expectations_and_for_a_run(
    stored: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "pairs", "--base", "0.9", "--change=-0.05"]) == 0
    assert "change of -5.0" in capsys.readouterr().out
    folder = stored("run", seed=1)
    main(["report", folder])
    assert main(["plan", "pairs", "--run", folder]) == 0
    assert "camera_shift" in capsys.readouterr().out


def test_a_gate_is_planned(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate_plan, "SIZES", (8, 16, 32, 64, 100, 200, 400))  # more take seconds
    gate = ["plan", "gates", "--base", "0.9", "--gate", "dynamic_sr_vs(v1).lower >= -10%"]
    assert main([*gate, "--pairs", "100", "--loss", "0.2"]) == 0
    out = capsys.readouterr().out
    assert "decided on 100 pairs" in out
    assert "no effect" in out
    assert "with -19.0 pp: 100, 200, 400" in out
    assert main(["plan", "gates", "--base", "0.9", "--gate", "event.camera_shift.delta >= -30%"]) == 0
    assert "decided on 4 pairs" in capsys.readouterr().out
    for wrong, words in (
        ([*gate, "--loss", "0.95"], "only what succeeds in Base can be lost"),
        (["plan", "gates", "--base", "0.9", "--gate", "event.nothing.delta >= -30%"], "unknown event"),
    ):
        assert main(wrong) == 1
        assert words in capsys.readouterr().err
