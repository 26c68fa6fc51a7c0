from __future__ import annotations

from itertools import cycle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import OPERATORS, evaluate, parse_gate, parse_gates
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of

PAIRS = plan()


def _report(played: int = 32) -> Json:
    outcomes = cycle([(True, True), (True, False), (True, True), (False, True)])
    records = [record_of(pair, *outcome) for pair, outcome in zip(PAIRS, outcomes, strict=False)]
    return build_report(records[:played], [error_of(PAIRS[-1])] if played < 32 else [], PAIRS, PROVENANCE)


REPORT = _report()
"""24 Base successes, 24 Dynamic successes; 8 regressions and 8 gains."""

CONTRAST: Json = {
    "first_only": 3,
    "second_only": 1,
    "difference": {"value": -0.0625, "lower": -0.2, "upper": 0.05},
    "p_value": 0.625,
}


@pytest.mark.parametrize(
    ("text", "value", "passed"),
    [
        ("dynamic_sr >= 0.6", 0.75, True),
        ("dynamic_sr >= 80%", 0.75, False),
        ("base_sr==0.75", 0.75, True),
        ("base_sr != 75%", 0.75, False),
        ("delta >= -0.15", 0.0, True),
        ("delta > 0", 0.0, False),
        ("delta < 1e-3", 0.0, True),
        ("event.illumination_switch.conditional_regression <= 0.3", 0.5, False),
        ("event.camera_shift.played == 4", 4, True),
        ("family.geometry.regressions <= 2", 2, True),
        ("variant.camera_shift-v1.gains >= 1", 2, True),
        ("category.pro-position.dynamic_sr >= .5", 0.75, True),
        ("difficulty.3.base_sr >= +.5", 0.75, True),
        ("missing == 0", 0, True),
        ("invalid == 0", 0, True),
        ("planned >= 32", 32, True),
        ("retained >= 1", 1.0, True),
        ("p_value > 5%", 1.0, True),
        ("stale_mean <= 2", 2.0, True),
        ("stale_median <= 1", 2.0, False),
        ("trigger_coverage >= 0.9", 1.0, True),
    ],
)
def test_a_gate_is_decided(text: str, value: float, passed: bool) -> None:
    result = evaluate(parse_gate(text), REPORT)
    assert result.value == pytest.approx(value)
    assert result.verdict == ("passed" if passed else "failed")
    assert result.reason == f"{text}: {result.verdict}, it is {value:.6g}."


def test_interval_ends_are_addressable() -> None:
    change = REPORT["overall"]["paired_change"]
    assert evaluate(parse_gate("delta.lower >= -1"), REPORT).value == change["lower"]
    assert evaluate(parse_gate("delta.upper <= 1"), REPORT).value == change["upper"]
    assert evaluate(parse_gate("source.pro.base_sr.lower > 0"), REPORT).passed


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("regressions_vs(old) <= 3", 3),
        ("gains_vs(old) >= 1", 1),
        ("dynamic_sr_vs('old') >= -10%", -0.0625),
        ("dynamic_sr_vs(old).lower >= -0.3", -0.2),
        ("p_value_vs(old) > 0.05", 0.625),
    ],
)
def test_another_run_is_addressable(text: str, value: float) -> None:
    result = evaluate(parse_gate(text), REPORT, {"old": CONTRAST})
    assert result.passed
    assert result.value == value


def test_a_gate_against_a_run_that_is_not_there_is_undecidable() -> None:
    gate = parse_gate("regressions_vs(old) <= 3")
    assert evaluate(gate, REPORT).reason.endswith("undecidable, there is no comparison with 'old'.")
    result = evaluate(gate, REPORT, {"old": "Cannot read old."})
    assert result.verdict == "undecidable"
    assert result.reason == "regressions_vs(old) <= 3: undecidable, Cannot read old."


def test_missing_pairs_make_rates_undecidable_and_counts_not() -> None:
    report = _report(played=30)
    rate = evaluate(parse_gate("dynamic_sr >= 0"), report)
    assert rate.verdict == "undecidable"
    assert rate.reason == "dynamic_sr >= 0: undecidable, 30 of 32 planned pairs of the run were played."
    assert evaluate(parse_gate("missing == 0"), report).verdict == "failed"
    assert evaluate(parse_gate("invalid == 1"), report).passed
    assert evaluate(parse_gate("event.illumination_switch.base_sr > 0"), report).passed
    assert (
        evaluate(parse_gate("regressions_vs(old) <= 99"), report, {"old": CONTRAST}).verdict == "undecidable"
    )
    versus = evaluate(parse_gate("event.obstacle_insertion.base_sr >= 0"), report)
    assert "2 of 4 planned pairs of event obstacle_insertion" in versus.reason


def test_a_zero_denominator_makes_a_gate_undecidable() -> None:
    records = [record_of(pair, False, False, **NEVER_TRIGGERED) for pair in PAIRS]
    report = build_report(records, [], PAIRS, PROVENANCE)
    for name in ("conditional_regression", "retained", "stale_mean"):
        result = evaluate(parse_gate(f"{name} <= 99"), report)
        assert result.verdict == "undecidable"
        assert f"no pair to measure {name} on" in result.reason


def test_without_a_changed_pair_the_p_value_is_one() -> None:
    report = build_report([record_of(pair, True, True) for pair in PAIRS], [], PAIRS, PROVENANCE)
    assert evaluate(parse_gate("p_value == 1"), report).passed


def test_a_group_the_run_does_not_have_is_undecidable_with_a_hint() -> None:
    result = evaluate(parse_gate("suite.libero_spacial.dynamic_sr >= 0.5"), REPORT)
    assert result.verdict == "undecidable"
    assert "Did you mean 'libero_spatial'?" in result.reason


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dynamic_sr", "is not a condition"),
        ("", "is not a condition"),
        ("dynamic_sr = 0.5", "is not a condition"),
        ("dynamic_sr >= high", "must compare with a number"),
        ("dynamic_sr >= nan", "must compare with a number"),
        ("dynamic_sr >= 1e999", "finite number"),
        ("dynamic_rs >= 0.5", "Did you mean 'dynamic_sr'?"),
        ("event.camera_shfit.delta >= 0", "Did you mean 'camera_shift'?"),
        ("family.geomtry.delta >= 0", "Did you mean 'geometry'?"),
        ("evnt.camera_shift.delta >= 0", "Did you mean 'event'?"),
        ("event.camera_shift >= 0", "without group and quantity"),
        ("event.camera_shift.missing == 0", "unknown quantity 'missing'"),
        ("delta.lowr >= 0", "Did you mean 'lower'?"),
        ("delta.lower.lower >= 0", "no such part"),
        ("regressions.lower >= 0", "no such part"),
        ("regression_vs(old) <= 3", "Did you mean 'regressions_vs'?"),
        ("regressions_vs(old).lower <= 3", "which has no interval"),
    ],
)
def test_what_is_not_in_the_language_is_refused(text: str, words: str) -> None:
    with pytest.raises(OptionError) as caught:
        parse_gate(text)
    assert words in str(caught.value)
    assert repr(text) in str(caught.value)


def test_gates_come_from_lines_with_comments() -> None:
    gates = parse_gates(["dynamic_sr >= 0.6  # released 0.7", "\n# nothing\nmissing == 0\n\n"])
    assert [gate.text for gate in gates] == ["dynamic_sr >= 0.6", "missing == 0"]


@given(st.sampled_from([">=", ">"]), st.floats(-2, 2), st.floats(0, 1))
def test_a_stricter_threshold_never_opens_a_gate(sign: str, threshold: float, more: float) -> None:
    loose = evaluate(parse_gate(f"delta {sign} {threshold:.6f}"), REPORT)
    strict = evaluate(parse_gate(f"delta {sign} {threshold + more:.6f}"), REPORT)
    assert loose.passed or not strict.passed


@given(st.text(max_size=40))
def test_no_text_breaks_the_parser(text: str) -> None:
    try:
        gate = parse_gate(text)
    except OptionError:
        return
    assert gate.operator in OPERATORS
