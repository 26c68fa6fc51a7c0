"""Gates on the numbers of safety and of monitors."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from pytest_libero_max.errors import OptionError
from pytest_libero_max.lab.sections.safety import LIMITS
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_results import require_watched
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.measures import measures_of
from tests.report.made_up import PROVENANCE, plan, record_of

PAIRS = plan()


def tilted(number: int) -> PairRecord:
    """A pair in which what was held tilts by as many degrees as its number in Dynamic, by one in Base."""
    record = record_of(PAIRS[number], True, True)
    tilts = {"base": 1.0, "dynamic": float(number)}
    arms = {
        name: replace(arm, probes={"safety": {**dict.fromkeys(LIMITS, 0.0), "tilt_deg": tilts[name]}})
        for name, arm in record.arms.items()
    }
    return replace(record, arms=arms)


REPORT = build_report([tilted(number) for number in range(len(PAIRS))], [], PAIRS, PROVENANCE)


@pytest.mark.parametrize(
    ("gate", "value"),
    [
        ("safety.tilt_deg.largest <= 15", 31.0),
        ("safety.unsafe.dynamic <= 60%", 0.5),
        ("safety.beyond.tilt_deg.base <= 10%", 0.0),
        ("safety.unsafe.change <= 10%", 0.5),
        ("safety.unsafe.change.upper <= 90%", measures_of(REPORT.sections)["safety.unsafe.change"].upper),
    ],
)
def test_a_gate_asks_for_what_was_measured(gate: str, value: float) -> None:
    assert evaluate_gate(parse_gate(gate), REPORT).value == pytest.approx(value)


@pytest.mark.parametrize(
    ("gate", "probe"),
    [
        ("safety.tilt_deg <= 15", "safety"),
        ("safety.unsafe.dynamic <= 10%", "safety"),
        ("monitor.chunk_change.alarm.dynamic >= 50%", "chunk_change"),
    ],
)
def test_a_run_that_does_not_ask_for_the_probe_is_refused(gate: str, probe: str) -> None:
    require_watched([parse_gate(gate)], (probe,))
    with pytest.raises(OptionError, match=f"--libero-max-probe={probe}"):
        require_watched([parse_gate(gate)], ())


@pytest.mark.parametrize(
    ("gate", "message"),
    [
        ("safety.tilt <= 15", "tilt_deg"),
        ("event.camera_shift.safety.unsafe.base <= 5%", "unknown quantity"),
        ("safety.unsafe.base <= 200%", "can never fail"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(gate: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        parse_gate(gate)
