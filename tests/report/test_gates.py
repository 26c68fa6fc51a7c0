from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction
from itertools import cycle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from pytest_libero_max.errors import OptionError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_quantities import GATED
from pytest_libero_max.report.gate_reach import EXACT, extremes, require_reachable, require_reachable_vs
from pytest_libero_max.report.gates import (
    OPERATORS,
    Gate,
    decided_value,
    evaluate_gate,
    parse_gate,
    parse_gates,
    require_known_groups,
)
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.blocks import Interval, SuccessContrast, SuccessDifference
from pytest_libero_max.stats.paired import Pairs, measure
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plain, plan, record_of, selected

PAIRS = plan()


def _report(played: int = 32) -> Report:
    outcomes = cycle([(True, True), (True, False), (True, True), (False, True)])
    records = [record_of(pair, *outcome) for pair, outcome in zip(PAIRS, outcomes, strict=False)]
    return build_report(records[:played], [error_of(PAIRS[-1])] if played < 32 else [], PAIRS, PROVENANCE)


REPORT = _report()
"""24 Base successes, 24 Dynamic successes; 8 regressions and 8 gains."""


def _report_of_change(losses: int, gains: int, pairs: int) -> Report:
    planned = plan(per_cell=8)[:pairs]
    fates = [(True, False)] * losses + [(False, True)] * gains + [(True, True)] * pairs
    records = [record_of(pair, *fate) for pair, fate in zip(planned, fates, strict=False)]
    return build_report(records, [], planned, PROVENANCE)


NO_INTERVAL = Interval(lower=None, upper=None)

CONTRAST = SuccessContrast(
    first="old",
    second="now",
    cases=32,
    first_only=3,
    second_only=1,
    difference=SuccessDifference(
        value=-0.0625, lower=-0.2, upper=0.05, simultaneous=NO_INTERVAL, bootstrap=NO_INTERVAL
    ),
    p_value=0.625,
    log10_p_value=-0.204,
    log10_p_value_holm=-0.204,
)


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
    result = evaluate_gate(parse_gate(text), REPORT)
    assert result.value == pytest.approx(value)
    assert result.verdict == ("passed" if passed else "failed")
    shown = f"{100 * value:.1f}%" if text.endswith("%") else f"{value:.12g}"
    assert result.reason == f"{text}: {result.verdict}, it is {shown}."


def test_interval_ends_are_addressable() -> None:
    change = plain(REPORT)["overall"]["paired_change"]
    assert evaluate_gate(parse_gate("delta.lower >= -0.9"), REPORT).value == change["lower"]
    assert evaluate_gate(parse_gate("delta.upper <= 0.9"), REPORT).value == change["upper"]
    assert evaluate_gate(parse_gate("source.pro.base_sr.lower > 0"), REPORT).passed


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
    result = evaluate_gate(parse_gate(text), REPORT, {"old": CONTRAST})
    assert result.passed
    assert result.value == value


def test_a_gate_against_a_run_that_is_not_there_is_undecidable() -> None:
    gate = parse_gate("regressions_vs(old) <= 3")
    assert evaluate_gate(gate, REPORT).reason.endswith("no comparison with 'old'.")
    result = evaluate_gate(gate, REPORT, {"old": "Cannot read old."})
    assert result.verdict == "undecidable"
    assert result.reason == f"{gate.text}: undecidable, Cannot read old."


def test_missing_pairs_make_rates_undecidable_and_counts_not() -> None:
    report = _report(played=30)
    rate = evaluate_gate(parse_gate("dynamic_sr > 0"), report)
    assert rate.verdict == "undecidable"
    assert "30 of 32 planned pairs" in rate.reason
    assert evaluate_gate(parse_gate("missing == 0"), report).verdict == "failed"
    assert evaluate_gate(parse_gate("invalid == 1"), report).passed
    assert evaluate_gate(parse_gate("event.illumination_switch.base_sr > 0"), report).passed
    assert (
        evaluate_gate(parse_gate("regressions_vs(old) <= 99"), report, {"old": CONTRAST}).verdict
        == "undecidable"
    )
    versus = evaluate_gate(parse_gate("event.obstacle_insertion.base_sr > 0"), report)
    assert "2 of 4 planned pairs" in versus.reason


def test_a_zero_denominator_makes_a_gate_undecidable() -> None:
    records = [record_of(pair, False, False, **NEVER_TRIGGERED) for pair in PAIRS]
    report = build_report(records, [], PAIRS, PROVENANCE)
    for name in ("conditional_regression", "retained", "stale_mean"):
        result = evaluate_gate(parse_gate(f"{name} <= 0.9"), report)
        assert result.verdict == "undecidable"
    assert "to measure stale_mean" in result.reason


def test_without_a_changed_pair_the_p_value_is_one() -> None:
    report = build_report([record_of(pair, True, True) for pair in PAIRS], [], PAIRS, PROVENANCE)
    assert evaluate_gate(parse_gate("p_value == 1"), report).passed


def test_a_group_the_run_does_not_have_is_undecidable_with_a_hint() -> None:
    result = evaluate_gate(parse_gate("suite.libero_spacial.dynamic_sr >= 0.5"), REPORT)
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
        ("dynamic_sr >= 1e999", "can never hold"),
        ("dynamic_sr >= 1e9999999", "so large or so small"),
        ("dynamic_sr >= 1e" + "9" * 5000, "so large or so small"),
        # What can never fail or never hold tests nothing.
        ("delta >= -15", "can never fail: delta is a difference of shares from -1 to 1"),
        ("delta >= -1500%", "can never fail"),
        ("delta <= 1", "can never fail"),
        ("delta > 1", "can never hold"),
        ("delta.lower < -1", "can never hold"),
        ("delta.clustered.lower >= -1", "can never fail"),
        ("event.camera_shift.delta >= -15", "can never fail"),
        ("dynamic_sr <= 60", "can never fail: dynamic_sr is a share from 0 to 1. Write 60% or 0.6."),
        ("dynamic_sr >= 62.5", "Write 62.5% or 0.625."),
        ("delta >= -15", "Write -15% or -0.15."),
        ("delta >= -1500%", "Give a number that decides something."),
        ("dynamic_sr >= 100", "Give a number that decides something."),
        ("dynamic_sr >= 0", "can never fail"),
        ("dynamic_sr == 60", "can never hold"),
        ("dynamic_sr != 60", "can never fail"),
        ("regressions <= 3%", "with a percentage, but it is a count"),
        ("regressions_vs(old) <= 3%", "with a percentage, but it is a count"),
        ("stale_mean <= 10%", "with a percentage"),
        ("regressions >= 0", "can never fail"),
        ("regressions < 0", "can never hold"),
        ("regressions == 2.5", "can never hold"),
        ("missing != -1", "can never fail"),
        ("retained >= -1", "can never fail"),
        ("p_value <= 1", "can never fail"),
        ("p_value_vs(old) > 1", "can never hold"),
        ("dynamic_sr_vs(old) >= -10", "can never fail"),
        ("whole_track == 2", "can never hold"),
        ("whole_track >= 0", "can never fail"),
        ("delta.clusterd.lower >= -0.1", "has no such part"),
        ("event.camera_shift.whole_track == 1", "unknown quantity 'whole_track'"),
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


@given(st.sampled_from([">=", ">"]), st.floats(-0.9, 0.4), st.floats(0, 0.5))
def test_a_stricter_threshold_never_opens_a_gate(sign: str, threshold: float, more: float) -> None:
    loose = evaluate_gate(parse_gate(f"delta {sign} {threshold:.6f}"), REPORT)
    strict = evaluate_gate(parse_gate(f"delta {sign} {threshold + more:.6f}"), REPORT)
    assert loose.passed or not strict.passed


def test_a_percentage_is_exactly_its_hundredth() -> None:
    report = _report_of_change(7, 0, 250)
    assert plain(report)["overall"]["paired_change"]["value"] == -0.028
    assert -2.8 / 100 > -0.028, "as floating-point numbers the two differ"
    for text in ("delta >= -2.8%", "delta <= -2.8%", "delta == -2.8%", "delta >= -0.028"):
        assert evaluate_gate(parse_gate(text), report).passed, text
    assert not evaluate_gate(parse_gate("delta > -2.8%"), report).passed


@given(st.integers(1, 120).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_gate_set_at_the_value_a_run_reports_holds(counts: tuple[int, int]) -> None:
    value = Fraction(*counts)
    reported = f"{float(value):.12g}"
    rate = replace(REPORT.overall.dynamic_success, value=float(reported), lower=0.0, upper=1.0)
    report = replace(REPORT, overall=replace(REPORT.overall, dynamic_success=rate))
    for number in (reported, f"{100 * Decimal(reported):f}%"):
        for sign in (">=", "<=", "=="):
            if value == {">=": 0, "<=": 1}.get(sign):
                continue  # such a gate can never fail
            assert evaluate_gate(parse_gate(f"dynamic_sr {sign} {number}"), report).passed


def test_four_alike_pairs_do_not_pass_a_gate_on_the_lower_end() -> None:
    pairs = plan()
    report = build_report([record_of(pair, True, True) for pair in pairs], [], pairs, PROVENANCE)
    result = evaluate_gate(parse_gate("event.camera_shift.delta.lower >= -5%"), report)
    assert result.verdict == "failed"
    assert result.value == pytest.approx(0.025**0.25 - 1, abs=1e-8)


def test_an_interval_by_task_needs_tasks() -> None:
    result = evaluate_gate(parse_gate("delta.clustered.lower >= -0.5"), REPORT)
    assert result.verdict == "undecidable"
    assert "too few tasks (1 of 30" in result.reason
    assert evaluate_gate(parse_gate("delta.clustered >= -0.5"), REPORT).passed


def test_an_interval_by_task_decides_where_there_are_enough() -> None:
    pairs = [replace(pair, task=f"suite/{index % 40}") for index, pair in enumerate(plan(per_cell=4))]
    records = [record_of(pair, True, index % 3 > 0) for index, pair in enumerate(pairs)]
    report = build_report(records, [], pairs, PROVENANCE)
    by_task = plain(report)["overall"]["paired_change"]["by_task"]
    assert by_task["tasks"] >= 30
    assert by_task["lower"] <= plain(report)["overall"]["paired_change"]["lower"] < -0.3
    result = evaluate_gate(parse_gate("delta.clustered.lower >= -0.9"), report)
    assert result.passed
    assert result.value == by_task["lower"]


@pytest.mark.parametrize(("whole", "verdict"), [(True, "passed"), (False, "failed")])
def test_only_a_whole_track_is_one(whole: bool, verdict: str) -> None:
    report = replace(REPORT, selection=selected(whole))
    assert evaluate_gate(parse_gate("whole_track == 1"), report).verdict == verdict


def test_a_run_that_takes_a_part_for_its_track_is_undecidable() -> None:
    report = replace(REPORT, selection=replace(selected(True), of=3, chosen=3))
    result = evaluate_gate(parse_gate("whole_track == 1"), report)
    assert result.verdict == "undecidable"
    assert re.findall(r"smoke|\d+", result.detail) == ["smoke", "3", "32"]


def test_a_run_that_does_not_say_its_selection_decides_nothing_about_it() -> None:
    report = replace(REPORT, selection=None)
    result = evaluate_gate(parse_gate("whole_track == 1"), report)
    assert result.verdict == "undecidable"


@pytest.mark.parametrize(
    ("quantity", "words"),
    [
        ("suite.libero_spacial", "Did you mean 'libero_spatial'?"),
        ("category.pro-positon", "Did you mean 'pro-position'?"),
        ("variant.camera_shift-v2", "Did you mean 'camera_shift-v1'?"),
        ("difficulty.9", "Known: 3, none."),
        ("source.max", "Known: plus, pro."),
        ("severity.mild", "names the severity 'mild', which no case is of"),
    ],
)
def test_a_group_that_no_case_is_of_is_refused(quantity: str, words: str) -> None:
    with pytest.raises(OptionError) as caught:
        require_known_groups([parse_gate(f"{quantity}.delta >= -0.1")], PAIRS)
    assert words in str(caught.value)


def test_known_groups_are_not_refused() -> None:
    require_known_groups(
        parse_gates(["suite.libero_spatial.delta >= -0.1", "difficulty.none.base_sr > 0", "missing == 0"]),
        PAIRS,
    )


@given(st.text(max_size=40))
def test_no_text_breaks_the_parser(text: str) -> None:
    try:
        gate = parse_gate(text)
    except OptionError:
        return
    assert gate.operator in OPERATORS


def test_a_value_is_shown_in_the_unit_of_its_gate_and_on_its_side() -> None:
    report = _report_of_change(losses=17, gains=0, pairs=32)
    result = evaluate_gate(parse_gate("delta.lower >= -15%"), report)
    assert result.reason == f"{result.gate.text}: failed, it is -70.9%."
    near = evaluate_gate(parse_gate("delta >= -53.12%"), report)
    assert near.reason == f"{near.gate.text}: failed, it is -53.13%."


def test_a_change_without_fired_events_or_base_successes_is_undecidable() -> None:
    planned = plan()
    never = [record_of(pair, True, True, **NEVER_TRIGGERED) for pair in planned]
    failing = [record_of(pair, False, False) for pair in planned]
    for records, words in ((never, "happened in 0 of 32 pairs"), (failing, "Base solves 0 of ")):
        report = build_report(records, [], planned, PROVENANCE)
        for text in ("delta.lower >= -15%", "regressions <= 3", "family.geometry.delta >= -50%"):
            result = evaluate_gate(parse_gate(text), report)
            assert result.verdict == "undecidable"
            assert words.split(" in ")[0] in result.reason
        for text in (
            "dynamic_sr_vs(old).lower >= -30%",
            "regressions_vs(old) <= 3",
            "equivalent_vs(old, 40%)",
        ):
            assert words in evaluate_gate(parse_gate(text), report, {"old": CONTRAST}).reason
    assert evaluate_gate(parse_gate("base_sr >= 50%"), build_report(never, [], planned, PROVENANCE)).passed


@pytest.mark.parametrize(("margin", "verdict"), [("40%", "passed"), ("0.1", "failed")])
def test_equivalence_is_decided_by_both_ends_of_a_90_interval(margin: str, verdict: str) -> None:
    from pytest_libero_max.stats.paired_difference import paired_difference

    interval = paired_difference(3, 1, 32, 0.9)
    assert interval is not None
    result = evaluate_gate(parse_gate(f"equivalent_vs(old, {margin})"), REPORT, {"old": CONTRAST})
    assert result.verdict == verdict
    assert result.value == max(-interval.lower, interval.upper)
    assert "the 90% interval reaches" in result.reason


@pytest.mark.parametrize(
    "text",
    ["equivalent_vs(old) <= 5%", "equivalent_vs(old, much)", "equivalent_vs(old, 0)", "equivalent_vs(5%)"],
)
def test_equivalence_that_is_spelled_wrong_is_refused(text: str) -> None:
    with pytest.raises(OptionError, match="gate="):
        parse_gate(text)


def test_a_difference_that_no_outcome_reaches_is_refused() -> None:
    alike = [True] * 32
    with pytest.raises(OptionError, match="32 of the 32 there"):
        require_reachable_vs(parse_gate("dynamic_sr_vs(old).lower >= -5%"), alike)
    with pytest.raises(OptionError, match="its 32 pairs"):
        require_reachable_vs(parse_gate("equivalent_vs(old, 5%)"), alike)
    for text in ("dynamic_sr_vs(old).lower >= -12%", "equivalent_vs(old, 12%)", "regressions_vs(old) <= 3"):
        require_reachable_vs(parse_gate(text), alike)
    require_reachable_vs(parse_gate("dynamic_sr_vs(old).lower >= -5%"), alike * 25)


@pytest.mark.parametrize(
    "text",
    [
        "stale_mean > 3",
        "stale_median >= 20",
        "trigger_coverage < 1",
        "response_coverage <= 50%",
        "stale_mean < 1",
    ],
)
def test_a_gate_on_stale_actions_or_coverage_is_one_that_can_hold(text: str) -> None:
    require_reachable(parse_gate(text), plan())


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("regressions <= 32", "fail"),
        ("regressions != 33", "fail"),
        ("event.camera_shift.regressions < 5", "fail"),
        ("gains <= 32", "fail"),
        ("persistent_failure < 33", "fail"),
        ("base_sr.lower < 95%", "fail"),
        ("base_sr.upper > 5%", "fail"),
        ("p_value >= 1e-10", "fail"),
        ("delta <= 90%", "fail"),
        ("invalid <= 32", "fail"),
        ("played <= 32", "fail"),
        ("played >= 33", "hold"),
        ("missing == 33", "hold"),
        ("regressions == 33", "hold"),
        ("regressions >= 33", "hold"),
        ("base_sr.lower >= 90%", "hold"),
        ("delta > 80%", "hold"),
    ],
)
def test_a_gate_that_decides_nothing_on_its_pairs_is_refused(text: str, word: str) -> None:
    with pytest.raises(OptionError, match=f"can never {word}: .* pairs"):
        require_reachable(parse_gate(text), plan())


@pytest.mark.parametrize(
    "text",
    [
        "planned >= 32",
        "whole_track == 1",
        "regressions <= 31",
        "regressions != 32",
        "gains <= 31",
        "base_sr <= 10%",
        "persistent_failure <= 31",
        "delta.clustered >= -90%",
        "given_response_paired_change <= 90%",
    ],
)
def test_a_gate_that_may_fail_and_hold_is_not_refused(text: str) -> None:
    require_reachable(parse_gate(text), plan())


@pytest.mark.parametrize(
    ("text", "succeeded", "word"),
    [
        ("regressions_vs(old) <= 0", 0, "fail"),
        ("regressions_vs(old) <= 3", 3, "fail"),
        ("regressions_vs(old) == 0", 0, "fail"),
        ("dynamic_sr_vs(old) >= -5%", 0, "fail"),
        ("dynamic_sr_vs(old) >= -5%", 1, "fail"),
        ("dynamic_sr_vs(old).lower >= -20%", 0, "fail"),
        ("dynamic_sr_vs(old) <= 5%", 32, "fail"),
        ("gains_vs(old) >= 1", 32, "hold"),
        ("gains_vs(old) != 40", 0, "fail"),
        ("p_value_vs(old) > 1e-10", 16, "fail"),
        ("regressions_vs(old) > 3", 3, "hold"),
        ("dynamic_sr_vs(old) > 0", 32, "hold"),
    ],
)
def test_a_gate_against_a_run_that_leaves_nothing_to_decide_is_refused(
    text: str, succeeded: int, word: str
) -> None:
    earlier = [True] * succeeded + [False] * (32 - succeeded)
    with pytest.raises(OptionError, match=f"can never {word}: .* succeeded in {succeeded} of the 32 there"):
        require_reachable_vs(parse_gate(text), earlier)


EXTREME = [
    (name, end)
    for name, column in GATED.items()
    for end in ((None, "lower", "upper") if column.format.has_interval else (None,))
    if name in EXACT
]


@pytest.mark.parametrize(("name", "end"), EXTREME)
def test_no_outcome_lies_beyond_the_extreme_ones(name: str, end: str | None) -> None:
    gate = Gate("", name, None, end, None, ">=", Fraction(1, 2))
    random = np.random.default_rng(7)
    for pairs in (1, 3, 8, 32):
        planned = plan()[:pairs]
        found = [
            value for one in extremes(planned) if (value := decided_value(gate, measure(one))) is not None
        ]
        for _ in range(12):
            often = random.random(4) ** random.choice([0.2, 1, 3])
            base, triggered, answered, completes = (often > random.random((4, pairs)).T).T
            outcome = Pairs.of(
                base=base,
                dynamic=np.where(triggered, completes, base),
                triggered=triggered,
                responded=triggered & answered,
                stale=np.where(triggered, random.integers(0, 50, pairs), -1),
                source=[pair.source for pair in planned],
                task=[pair.task for pair in planned],
            )
            value = decided_value(gate, measure(outcome))
            assert value is None or min(found) - 1e-12 <= value <= max(found) + 1e-12


@pytest.mark.parametrize(
    ("name", "gate"),
    [
        ("change", "delta"),
        ("paired_change", "delta"),
        ("base_success", "base_sr"),
        ("dynamic", "dynamic_sr"),
        ("lost", "conditional_regression"),
        ("event.camera_shift.change", "delta"),
    ],
)
def test_a_quantity_by_its_name_in_tables_is_answered_with_its_name_in_gates(name: str, gate: str) -> None:
    with pytest.raises(OptionError, match=f"Did you mean '{gate}'"):
        parse_gate(f"{name} >= 0.1")
