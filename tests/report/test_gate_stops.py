"""Rules that stop a run once its gates are decided: certain and anytime."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement, product
from typing import Any

import pytest

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gate_bounds import BOUNDED, Ending, all_endings, outlook
from pytest_libero_max.report.gate_results import decide_on
from pytest_libero_max.report.gates import Gate, evaluate_gate, parse_gate, parse_gates, value_in, verdict_in
from pytest_libero_max.report.quantities import QUANTITIES
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_texts import stopped_texts
from pytest_libero_max.report.stopping_rule import CompletedPrefix, Declared, parse_rule
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.store import StoredRun
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, run_of

GATES = (
    "delta >= -5%",
    "delta.lower > -30%",
    "delta.upper < 10%",
    "base_sr >= 60%",
    "base_sr.lower >= 50%",
    "dynamic_sr < 70%",
    "dynamic_sr.upper < 80%",
    "conditional_regression <= 20%",
    "conditional_regression.upper <= 50%",
    "retained >= 90%",
    "trigger_coverage >= 80%",
    "trigger_coverage.lower >= 50%",
    "response_coverage >= 70%",
    "regressions <= 2",
    "regressions == 1",
    "regressions != 1",
    "gains >= 1",
    "preserved_success >= 4",
    "persistent_failure < 3",
    "p_value >= 0.2",
    "p_value < 0.2",
)

KINDS = [
    (base, dynamic, fired, answered)
    for base, dynamic, fired, answered in product((True, False), repeat=4)
    if fired or not (answered or base != dynamic)
]
"""Ways in which a pair can end: without the event both arms are the same."""


def ending_of(pairs: Sequence[tuple[bool, bool, bool, bool]]) -> Ending:
    end = Ending()
    for base, dynamic, fired, answered in pairs:
        end += Ending(1, base, base and not dynamic, dynamic and not base, fired, answered)
    return end


def played(pair: PlannedPair, kind: tuple[bool, bool, bool, bool]) -> PairRecord:
    base, dynamic, fired, answered = kind
    changes: dict[str, Any] = {}
    if not fired:
        changes = {**NEVER_TRIGGERED, "dynamic_steps": 90}
    elif not answered:
        changes = {"response_step": None, "stale_actions": 72}
    return record_of(pair, base, dynamic, **changes)


@pytest.mark.parametrize("seed", range(3))
def test_an_ending_has_the_verdicts_of_its_report(seed: int) -> None:
    rng = random.Random(seed)
    kinds = rng.choices(KINDS[: rng.choice((2, 8, len(KINDS)))], k=16)
    planned = plan()[:16]
    records = [played(pair, kind) for pair, kind in zip(planned, kinds, strict=True)]
    report = build_report(records, [], planned, PROVENANCE)
    for gate in parse_gates(GATES):
        expected = evaluate_gate(gate, report)
        assert verdict_in(gate, ending_of(kinds)) == expected.verdict, gate.text
        if expected.value is not None:
            assert value_in(gate, ending_of(kinds)) == expected.value


def test_every_bounded_quantity_is_tried() -> None:
    tried = {gate.name for gate in parse_gates(GATES)}
    assert tried == set(BOUNDED)
    assert tried < {column.gate or column.key for column in QUANTITIES}


@pytest.mark.parametrize("text", GATES)
def test_one_verdict_at_the_extremes_is_that_of_every_ending(text: str) -> None:
    """Against all ways in which up to three pairs of eight can end."""
    gate, rng = parse_gate(text), random.Random(text)
    found = 0
    for left, _ in product((1, 2, 3), range(4)):
        seen = ending_of(rng.choices(KINDS[: rng.choice((1, 4, 8, len(KINDS)))], k=8 - left))
        ends = [seen + ending_of(more) for more in combinations_with_replacement(KINDS, left)]
        verdicts = {verdict_in(gate, end) for end in ends}
        outlined = outlook(gate, all_endings(seen, 8))
        if outlined.verdict is not None:
            assert verdicts == {outlined.verdict}
            found += 1
        elif "==" not in text and "!=" not in text:
            assert len(verdicts) > 1
    assert found


def stored_run(
    rule: str, gates: Sequence[str], outcomes: Sequence[tuple[bool, bool]], per_cell: int = 4
) -> tuple[StoredRun, Report, tuple[Gate, ...]]:
    """A run in a random order with these outcomes, as long as the rule lets it go on."""
    planned = plan(per_cell)
    random.Random(3).shuffle(planned)
    declared = parse_gates(gates)
    prefix = CompletedPrefix(parse_rule(rule), planned, declared)
    records, stopped = [], None
    for pair, (base, dynamic) in zip(planned, outcomes, strict=False):
        records.append(record_of(pair, base, dynamic))
        stopped = prefix.add(pair.item_id, records[-1])
        if stopped is not None:
            break
    provenance = {**PROVENANCE, "gates": list(gates), "stopping_rule": rule}
    report = build_report(records, [], planned, provenance, stopped)
    return replace(run_of(planned, records, provenance), stopped=stopped), report, declared


def test_certain_stops_where_nothing_can_change_a_gate_and_the_gate_is_decided(tmp_path: Any) -> None:
    outcomes = [(True, place % 2 == 0) for place in range(128)]
    stored, report, gates = stored_run("certain", ["delta >= -20%"], outcomes)
    assert stored.stopped is not None
    assert (stored.stopped.of, stored.stopped.rule, stored.stopped.at) == (128, "certain", 103)
    (result,) = decide_on(gates, stored, report, tmp_path)
    assert (result.verdict, result.value) == ("failed", None)
    assert re.findall(r"last 25 pairs|at most -20.3%", result.detail) == ["last 25 pairs", "at most -20.3%"]
    assert len(result.lost) == 51  # 25 of the others could still be gained
    (other,) = decide_on(parse_gates(["base_sr >= 10%"]), stored, report, tmp_path)
    assert other.verdict == "undecidable"  # it was not declared


def test_a_gate_without_bounds_is_never_certain() -> None:
    outcomes = [(True, True)] * 128
    stored, _, _ = stored_run("certain", ["base_sr >= 10%", "stale_mean <= 3"], outcomes)
    assert stored.stopped is None
    said = parse_rule("certain").rule.check(
        Declared(Order(), parse_gates(["base_sr >= 10%", "stale_mean <= 3", "whole_track == 1"]), 1, None)
    )
    assert said is not None
    assert said.endswith(" stale_mean <= 3; whole_track == 1")


@pytest.mark.parametrize("rule", ["certain", "anytime:0.05"])
def test_a_change_that_can_show_nothing_is_undecidable_early(rule: str, tmp_path: Any) -> None:
    stored, report, gates = stored_run(rule, ["delta.lower >= -5%"], [(False, False)] * 128)
    assert stored.stopped is not None
    (result,) = decide_on(gates, stored, report, tmp_path)
    assert (result.verdict, result.value) == ("undecidable", None)
    assert "too low" in result.reason


def test_a_rule_over_gates_decides_nothing_after_an_error() -> None:
    planned = plan()
    for rule in ("certain", "anytime"):
        prefix = CompletedPrefix(parse_rule(rule), planned, parse_gates(["regressions <= 1"]))
        pairs: list[PairRecord | PairError] = [
            error_of(planned[0]),
            *(record_of(pair, True, False) for pair in planned[1:]),
        ]
        assert [prefix.add(pair.item_id, pair) for pair in pairs] == [None] * len(planned)


def test_anytime_stops_early_with_the_interval_of_its_sequence(tmp_path: Any) -> None:
    outcomes = [(True, place % 3 == 0) for place in range(512)]
    stored, report, gates = stored_run("anytime:0.05", ["delta.lower >= -20%"], outcomes, 16)
    assert stored.stopped is not None
    assert stored.stopped.at is not None
    assert stored.stopped.at < 60
    assert report.pairs.stopped is not None
    (watched,) = report.pairs.stopped.watched
    assert (watched.what, watched.verdict, watched.level) == ("delta.lower >= -20%", "failed", 0.05)
    assert watched.lower is not None
    assert watched.upper is not None
    assert watched.lower < report.overall.outcomes.regression / -len(stored.records) < watched.upper < 0
    (result,) = decide_on(gates, stored, report, tmp_path)
    assert (result.verdict, result.reason) == ("failed", watched.text)
    for shown in ("\n".join(summary_lines(report)), markdown(report)):
        assert watched.text.split(";")[0] in shown.replace("\n", " ")


def test_without_gates_anytime_stops_at_a_change() -> None:
    outcomes = [(True, place % 3 == 0) for place in range(128)]
    stored, report, _ = stored_run("anytime", [], outcomes)
    assert stored.stopped is not None
    assert "8 lost, 0 gained, p = 0.035 at" in stored.stopped.reason
    assert report.pairs.stopped is not None
    (watched,) = report.pairs.stopped.watched
    assert watched.text == f"delta: {watched.detail}"
    assert "level 0.05" in watched.detail
    unchanged, _, _ = stored_run("anytime", [], [(True, True)] * 128)
    assert unchanged.stopped is None


@pytest.mark.parametrize("rule", ["anytime", "certain", "first_regression"])
def test_a_run_that_a_rule_stopped_has_no_interval_of_a_fixed_number_of_pairs(rule: str) -> None:
    outcomes = [(True, place % 3 == 0) for place in range(512)]
    gates = [] if rule != "certain" else ["delta >= -10%"]
    _, report, _ = stored_run(rule, gates, outcomes, 16 if rule == "anytime" else 4)
    for row in (report.overall, *report.by["event"].values()):
        for column in QUANTITIES:
            numbers = column.numbers(row)
            assert {name for name, value in numbers.items() if value is not None} <= {
                name for name in numbers if not name.endswith(("_lower", "_upper")) and "p_value" not in name
            }
    text = "\n".join(summary_lines(report))
    assert all(sentence[:60] in text for sentence in stopped_texts(report.pairs))
    assert "n/a" not in text.split("Base success")[1].split("\n")[0]
    assert "Intervals are 95%" not in markdown(report)


@pytest.mark.parametrize(
    ("rule", "order", "gates", "shards", "message"),
    [
        ("certain", "sorted", [], 1, "there is no gate"),
        ("certain", "sorted", ["delta >= -5%"], 2, "--libero-max-ray"),
        ("anytime", "sorted", [], 1, "in the order sorted"),
        ("anytime", "blocks:7", [], 1, "Add --libero-max-order=shuffled:SEED"),
        ("anytime", "shuffled:7", ["p_value >= 0.1"], 1, "gate='p_value >= 0.1' has no"),
        ("anytime", "shuffled:7", ["regressions == 3"], 1, "limits .* for delta, base_sr"),
    ],
)
def test_a_run_that_a_rule_cannot_decide_on_is_refused(
    rule: str, order: str, gates: list[str], shards: int, message: str
) -> None:
    with pytest.raises(OptionError, match=message):
        parse_rule(rule).rule.check(Declared(Order.parse(order), parse_gates(gates), shards, None))


def test_level_and_gates_are_declared_before_the_first_pair() -> None:
    def check(rule: str, gates: Sequence[str], begun: dict[str, Any]) -> None:
        parse_rule(rule).rule.check(Declared(Order.parse("shuffled:1"), parse_gates(gates), 1, begun))

    begun = {"stopping_rule": "anytime:0.05", "gates": ["delta >= -5%", "base_sr >= 50%"]}
    check("anytime", ["base_sr >= 50%", "delta >= -5%"], begun)
    check("anytime:0.050", ["base_sr >= 50%", "delta >= -5%"], begun)
    for rule, gates in (("anytime:0.1", begun["gates"]), ("anytime", ["delta >= -5%"]), ("anytime", [])):
        with pytest.raises(OptionError, match="declared before"):
            check(rule, gates, begun)
    with pytest.raises(OptionError, match="with no rule"):
        check("anytime", [], {})


@pytest.mark.parametrize("text", ["anytime:0", "anytime:0.6", "anytime:nan", "anytime:much", "certain:1"])
def test_bogus_arguments_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"anytime:LEVEL|no arguments"):
        parse_rule(text)
