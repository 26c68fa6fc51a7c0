from __future__ import annotations

import math
import random
import re
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.exit_status import ended_as_declared
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_texts import incomplete_text
from pytest_libero_max.report.stopping_rule import BIAS, STOPPING_RULES, CompletedPrefix, Declared, parse_rule
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.stats.sequential import log_evidence_of_change
from tests.report.made_up import PROVENANCE, error_of, plain, plan, record_of, run_of, write_run

Pair = PairRecord | PairError


def decision(rule: str, planned: list[PlannedPair], arrivals: list[Pair]) -> Stopped | None:
    prefix = CompletedPrefix(parse_rule(rule), planned, ())
    decisions = [prefix.add(pair.item_id, pair) for pair in arrivals]
    return next((stopped for stopped in decisions if stopped is not None), None)


@pytest.mark.parametrize("seed", range(5))
def test_a_decision_does_not_depend_on_what_arrives_first(seed: int) -> None:
    planned = plan()
    pairs: list[Pair] = [
        error_of(pair) if place in (4, 9, 11) else record_of(pair, True, place != 6)
        for place, pair in enumerate(planned)
    ]
    random.Random(seed).shuffle(pairs)
    for rule, at, words in (("errors:2", 10, "2 pairs "), ("first_regression", 7, planned[6].item_id)):
        stopped = decision(rule, planned, pairs)
        assert stopped == Stopped(stopped.reason if stopped else "", len(planned), rule, at)
        assert stopped.reason.startswith(words)
    assert decision("errors:4", planned, pairs) is None


def test_a_rule_sees_the_longest_completed_prefix_alone() -> None:
    planned = plan()
    prefix = CompletedPrefix(parse_rule("errors"), planned, ())
    assert prefix.add(planned[2].item_id, error_of(planned[2])) is None
    assert prefix.add(planned[0].item_id, record_of(planned[0], True, True)) is None
    stopped = prefix.add(planned[1].item_id, None)  # not played: the policy does not support its suite
    assert stopped is not None
    assert (stopped.of, stopped.rule, stopped.at) == (len(planned), "errors", 3)


@pytest.mark.parametrize("level", [0.05, 0.5])
def test_a_run_stops_once_it_is_shown_to_be_worse_than_another(tmp_path: Path, level: float) -> None:
    planned = plan()
    records = [record_of(pair, True, place not in (1, 2)) for place, pair in enumerate(planned)]
    before = write_run(tmp_path / "before", run_of(planned, records))
    rule = f"worse_than:{before}" if level == 0.05 else f"worse_than:{level:g},{before}"
    worse: list[Pair] = [record_of(pair, True, place in (1, 3)) for place, pair in enumerate(planned)]
    stopped = decision(rule, planned, worse)
    assert stopped is not None
    assert stopped.rule == rule
    # Pairs 0, 4, 5 and so on are lost, 1 is gained, and 2 and 3 end as before.
    lost = {0.05: 11, 0.5: 6}[level]
    p = math.exp(-log_evidence_of_change(lost, 1))
    assert p <= level < math.exp(-log_evidence_of_change(lost - 1, 1))
    assert f"{lost} lost, 1 gained, p = {p:.2g} at any time" in stopped.reason
    assert stopped.at == lost + 3
    better: list[Pair] = [record_of(pair, True, True) for pair in planned]
    assert decision(rule, planned, better) is None
    missing: list[Pair] = [error_of(pair) for pair in planned]
    assert decision(rule, planned, missing) is None


def test_a_run_that_another_one_is_worse_than_has_to_be_there_and_the_order_random(tmp_path: Path) -> None:
    rule = parse_rule(f"worse_than:{tmp_path}").rule
    with pytest.raises(OptionError, match="Add --libero-max-order=shuffled:SEED"):
        rule.check(Declared(Order(), (), 1, None))
    with pytest.raises(OptionError, match="cannot be read"):
        rule.check(Declared(Order(1, False), (), 1, None))


def test_a_decision_at_the_last_pair_stops_nothing() -> None:
    planned = plan()
    pairs: list[Pair] = [record_of(pair, True, pair != planned[-1]) for pair in planned]
    assert decision("first_regression", planned, pairs) is None


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("errors:0", ValueError, "expected errors:N"),
        ("errors:many", ValueError, "expected errors:N"),
        ("first_regression:2", ValueError, "no arguments"),
        ("worse_than:", ValueError, "worse_than:LEVEL,RUN"),
        ("worse_than:2,before", ValueError, "above 0 and up to 0.5"),
        ("worse_than:x,before", ValueError, "worse_than:0.01,reports/v1"),
        ("error:2", OptionError, "'error' .*'errors'"),
    ],
)
def test_a_rule_that_does_not_exist_or_takes_something_else(
    text: str, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        parse_rule(text)


def test_the_shipped_rules_are_found_by_their_files() -> None:
    assert {"anytime", "certain", "errors", "first_regression", "worse_than"} <= {*STOPPING_RULES}


def test_every_report_says_stopped_by_rule_at_t_of_n() -> None:
    planned = plan()
    records = [record_of(pair, True, True) for pair in planned[:5]]
    stopped = Stopped("enough is known", len(planned), "enough:5", 5)
    report = build_report(records, [], planned, PROVENANCE, stopped)
    assert Stopped.from_dict(stopped.to_dict()) == stopped
    assert plain(report)["pairs"]["stopped"] == {**stopped.to_dict(), "watched": [], "bias": BIAS}
    assert (plain(report)["pairs"]["complete"], plain(report)["headline"]["status"]) == (False, "withheld")
    assert stopped.text in plain(report)["headline"]["reason"]
    said = incomplete_text(report.pairs)
    assert re.findall(r"enough:5|\d+ of 32", said) == ["enough:5", "5 of 32", "5 of 32"]
    assert summary_lines(report)[0] == said
    assert f"**{said} " in markdown(report)
    assert ended_as_declared(report.pairs)


def test_a_stopped_run_with_an_error_did_not_end_as_declared() -> None:
    planned = plan()
    stopped = Stopped("1 pair could not be measured", len(planned), "errors", 1)
    pairs = build_report([], [error_of(planned[0])], planned, PROVENANCE, stopped).pairs
    assert not ended_as_declared(pairs)


def test_a_run_that_something_stopped_is_incomplete_and_says_why() -> None:
    planned = plan()
    records = [record_of(planned[0], True, True)]
    pairs = build_report(records, [], planned, PROVENANCE, Stopped("the policy cannot be played", 32))
    first = summary_lines(pairs)[0]
    assert re.findall(r"1 of 32|\d+ \w+ing|cannot be played", first) == [
        "1 of 32",
        "31 missing",
        "cannot be played",
    ]
    assert not ended_as_declared(pairs.pairs)


def test_a_run_of_which_nothing_is_left_is_complete() -> None:
    planned = plan()
    records = [record_of(pair, True, True) for pair in planned]
    report = build_report(records, [], planned, PROVENANCE, Stopped("stopping after 1 failures", 32))
    assert report.pairs.stopped is None
