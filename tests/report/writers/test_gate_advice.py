"""Advice on track, number of pairs and gate together."""

from __future__ import annotations

import re

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.report import gate_plan
from pytest_libero_max.report.gate_plan import FALSE_ALARM, MISS, SIZES, advice_lines, advised


def test_the_advised_gates_find_the_loss_and_pass_without_one() -> None:
    end, estimate = advised(0.9, 0.01, 0.05)
    assert [end.gate.text, estimate.gate.text] == ["delta.lower >= -5%", "delta >= -2.5%"]
    for advice in (end, estimate):
        assert advice.pairs is not None
        assert advice.without >= 1 - FALSE_ALARM
        assert advice.hurt <= MISS


def test_what_no_number_of_pairs_finds_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate_plan, "SIZES", SIZES[:5])  # thousands of pairs take long to plan
    lines = advice_lines(0.9, 0.05, 0.002)
    assert [re.findall(r"none|up to \d+", line) for line in lines[-4:-2]] == [["none", "up to 100"]] * 2


def test_power_advises_a_track_and_a_limit(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "pairs", "--base", "0.9", "--change=-0.05"]) == 0
    *_, end, estimate, _, beside = capsys.readouterr().out.splitlines()
    assert end.split("  ")[-1].strip() == "--libero-max-track=lite --libero-max-limit=200"
    assert estimate.split()[:3] == ["delta", ">=", "-2.5%"]
    assert re.findall("base_sr|trigger_coverage", beside) == ["base_sr", "trigger_coverage"]
    assert main(["plan", "pairs", "--base", "0.9", "--change=0.05"]) == 0
    assert "Gates that find" not in capsys.readouterr().out
