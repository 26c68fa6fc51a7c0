"""Gates on what probes measured and on the numbers of sections."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest
from msgspec.structs import replace

from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_quantities import section_quantities
from pytest_libero_max.report.gate_reach import require_reachable
from pytest_libero_max.report.gate_results import require_watched
from pytest_libero_max.report.gates import GateResult, evaluate_gate, parse_gate
from pytest_libero_max.report.measures import measures_of
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_tables import csv_text
from tests.report.made_up import PROVENANCE, plan, record_of

PAIRS = plan()


def moved(number: int) -> PairRecord:
    """A pair in which the hand goes as many metres as its number in Dynamic, and one in Base."""
    record = record_of(PAIRS[number], True, True)
    ways = {"base": 1.0, "dynamic": float(number)}
    rest: dict[str, Any] = {"jerk_m_s3": None, "step_m": [], "step_jerk_m_s3": []}
    arms = {
        name: replace(arm, probes={"motion": {**rest, "path_m": ways[name]}})
        for name, arm in record.arms.items()
    }
    return replace(record, arms=arms)


REPORT = build_report([moved(number) for number in range(len(PAIRS))], [], PAIRS, PROVENANCE)
UNWATCHED = build_report([record_of(pair, True, True) for pair in PAIRS], [], PAIRS, PROVENANCE)


def decided(text: str) -> GateResult:
    return evaluate_gate(parse_gate(text), REPORT)


@pytest.mark.parametrize(
    ("gate", "value"),
    [
        ("motion.path_m <= 15", 15.5),
        ("motion.path_m.dynamic <= 15", 15.5),
        ("motion.path_m.base <= 15", 1.0),
        ("motion.path_m.largest <= 15", 31.0),
        ("timing.way.dynamic <= 1", 0.0),
        ("timing.mean.change <= 3", 5.0),
    ],
)
def test_a_gate_asks_for_what_was_measured(gate: str, value: float) -> None:
    result = decided(gate)
    assert result.value == pytest.approx(value)
    assert result.passed == (value <= float(result.gate.threshold))


def test_a_gate_asks_for_a_probe_within_a_group() -> None:
    events = {pair.event for pair in PAIRS}
    values = {event: decided(f"event.{event}.motion.path_m <= 1000").value for event in events}
    for event, value in values.items():
        ways = [number for number, pair in enumerate(PAIRS) if pair.event == event]
        assert value == pytest.approx(sum(ways) / len(ways))


def test_an_interval_has_its_ends() -> None:
    change = measures_of(REPORT.sections)["timing.success.dynamic"]
    assert change.upper is not None
    assert decided("timing.success.dynamic.upper <= 900").value == change.upper


@pytest.mark.parametrize("gate", ["motion.path_m <= 15", "timing.way.dynamic <= 1"])
def test_what_nobody_watched_decides_nothing(gate: str) -> None:
    assert evaluate_gate(parse_gate(gate), UNWATCHED).verdict == "undecidable"
    require_reachable(parse_gate(gate), PAIRS)


@pytest.mark.parametrize(
    ("gate", "probe"),
    [
        ("event.camera_shift.motion.path_m <= 2", "motion"),
        ("timing.jerk.ratio <= 2", "motion"),
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
        ("motion.step_m <= 1", "path_m"),
        ("motion.path <= 1", "path_m"),
        ("timing.way.base.largest <= 50", "unknown part"),
        ("event.camera_shift.timing.way.base <= 5", "unknown quantity"),
        ("timing.mean.base >= -1", "can never fail"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(gate: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        parse_gate(gate)


def test_a_column_of_a_probe_is_in_csv_and_markdown() -> None:
    rows = [*csv.DictReader(io.StringIO(csv_text(REPORT)))]
    assert (rows[0]["motion.path_m.dynamic"], rows[0]["motion.path_m.dynamic_largest"]) == ("15.5", "31.0")
    assert all(row["motion.path_m.base"] == "1.0" for row in rows if row["dimension"] == "event")
    assert "| motion.path_m.dynamic | 15.5, largest 31 " in markdown(REPORT)


def test_every_number_of_a_section_has_a_name_for_gates() -> None:
    keys = measures_of(REPORT.sections).keys()
    assert keys
    assert keys <= {*section_quantities()}
    for key in section_quantities():
        assert parse_gate(f"{key} == 1").name == key


def test_a_number_of_a_section_is_in_csv_for_the_run_alone() -> None:
    rows = [*csv.DictReader(io.StringIO(csv_text(REPORT)))]
    change = measures_of(REPORT.sections)["timing.mean.change"]
    assert rows[0]["timing.mean.change"] == str(change.value)
    assert rows[0]["timing.success.dynamic_lower"]
    assert {row["timing.mean.change"] for row in rows[1:]} == {""}
