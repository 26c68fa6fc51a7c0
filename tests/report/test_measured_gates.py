"""Gates on what probes measured and on the numbers of sections."""

from __future__ import annotations

import csv
import io

import pytest
from msgspec.structs import replace

from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_quantities import MEASURED
from pytest_libero_max.report.gate_reach import require_reachable
from pytest_libero_max.report.gate_results import require_watched
from pytest_libero_max.report.gates import GateResult, evaluate_gate, parse_gate
from pytest_libero_max.report.run_tables import csv_text
from pytest_libero_max.report.safety import LIMITS
from pytest_libero_max.report.writers.markdown import markdown
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
UNWATCHED = build_report([record_of(pair, True, True) for pair in PAIRS], [], PAIRS, PROVENANCE)


def decided(text: str) -> GateResult:
    return evaluate_gate(parse_gate(text), REPORT)


@pytest.mark.parametrize(
    ("gate", "value"),
    [
        ("safety.tilt_deg <= 15", 15.5),
        ("safety.tilt_deg.dynamic <= 15", 15.5),
        ("safety.tilt_deg.base <= 15", 1.0),
        ("safety.tilt_deg.largest <= 15", 31.0),
        ("safety.unsafe.dynamic <= 60%", 0.5),
        ("safety.beyond.tilt_deg.base <= 10%", 0.0),
        ("safety.unsafe.change <= 10%", 0.5),
        ("timing.mean.change <= 3", 5.0),
    ],
)
def test_a_gate_asks_for_what_was_measured(gate: str, value: float) -> None:
    result = decided(gate)
    assert result.value == pytest.approx(value)
    assert result.passed == (value <= float(result.gate.threshold))


def test_a_gate_asks_for_a_probe_within_a_group() -> None:
    events = {pair.event for pair in PAIRS}
    values = {event: decided(f"event.{event}.safety.tilt_deg <= 1000").value for event in events}
    for event, value in values.items():
        tilts = [number for number, pair in enumerate(PAIRS) if pair.event == event]
        assert value == pytest.approx(sum(tilts) / len(tilts))


def test_an_interval_has_its_ends() -> None:
    change = REPORT.sections["Safety: successful but unsafe"]["Successful but unsafe, paired change"]
    assert decided("safety.unsafe.change.upper <= 90%").value == getattr(change, "upper", None)


@pytest.mark.parametrize("gate", ["safety.tilt_deg <= 15", "safety.unsafe.dynamic <= 10%"])
def test_what_nobody_watched_decides_nothing(gate: str) -> None:
    assert evaluate_gate(parse_gate(gate), UNWATCHED).verdict == "undecidable"
    require_reachable(parse_gate(gate), PAIRS)


@pytest.mark.parametrize(
    ("gate", "probe"),
    [
        ("safety.tilt_deg <= 15", "safety"),
        ("event.camera_shift.motion.path_m <= 2", "motion"),
        ("safety.unsafe.dynamic <= 10%", "safety"),
        ("timing.jerk.ratio <= 2", "motion"),
        ("monitor.chunk_change.alarm.dynamic >= 50%", "chunk_change"),
        ("timing.mean.change <= 3", None),
        ("delta.clustered.lower >= -10%", None),
        ("dynamic_sr_vs(RUN) >= -5%", None),
    ],
)
def test_a_run_that_does_not_ask_for_the_probe_is_refused(gate: str, probe: str | None) -> None:
    if probe is None:
        require_watched([parse_gate(gate)], ())
        return
    require_watched([parse_gate(gate)], (probe,))
    with pytest.raises(OptionError, match=f"--libero-max-probe={probe}"):
        require_watched([parse_gate(gate)], ())


@pytest.mark.parametrize(
    ("gate", "message"),
    [
        ("safety.tilt <= 15", "tilt_deg"),
        ("motion.step_m <= 1", "path_m"),
        ("safety.unsafe.base.largest <= 50%", "unknown part"),
        ("event.camera_shift.safety.unsafe.base <= 5%", "unknown quantity"),
        ("safety.unsafe.base <= 200%", "can never fail"),
        ("timing.mean.base >= -1", "can never fail"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(gate: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        parse_gate(gate)


def test_a_column_of_a_probe_is_in_csv_and_markdown() -> None:
    rows = [*csv.DictReader(io.StringIO(csv_text(REPORT)))]
    assert (rows[0]["safety.tilt_deg.dynamic"], rows[0]["safety.tilt_deg.dynamic_largest"]) == (
        "15.5",
        "31.0",
    )
    assert all(row["safety.tilt_deg.base"] == "1.0" for row in rows if row["dimension"] == "event")
    assert "| safety.tilt_deg.dynamic | 15.5, largest 31  32 pairs |" in markdown(REPORT)


def test_every_number_of_a_section_has_a_name_for_gates() -> None:
    keys = {getattr(value, "key", None) for rows in REPORT.sections.values() for value in rows.values()} - {
        None
    }
    assert keys
    assert keys <= {*MEASURED}
    for key in MEASURED:
        assert parse_gate(f"{key} == 0.5").name == key
