from __future__ import annotations

import math
from itertools import product

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.errors import OptionError
from pytest_libero_max.lab.strata import log_evidence
from pytest_libero_max.report.stopping_rule import Declared, parse_rule
from pytest_libero_max.stats.sequential import log_evidence_of_change
from tests.report.made_up import plan, record_of
from tests.report.test_stopping_rule import Pair, decision


def test_the_evidence_is_that_of_one_stratum_and_adds_up_where_they_differ() -> None:
    assert log_evidence([]) == 0.0
    assert log_evidence([(7, 2)]) == pytest.approx(log_evidence_of_change(7, 2))
    opposite = log_evidence([(9, 0), (0, 9)])
    assert log_evidence_of_change(9, 9) < 0 < opposite
    assert opposite > 2 * log_evidence_of_change(9, 0) - math.log(2)


def test_the_evidence_never_grows_on_average_from_any_state() -> None:
    """The next discordant pair is of any of the strata, and a loss or a gain with chance 1/2 there."""
    for counts in product(product(range(4), repeat=2), repeat=2):
        for place in (0, 1):
            mean = 0.0
            for kind in (0, 1):
                after = [list(stratum) for stratum in counts]
                after[place][kind] += 1
                mean += math.exp(log_evidence([(lost, gained) for lost, gained in after])) / 2
            assert mean == pytest.approx(math.exp(log_evidence([(lost, gained) for lost, gained in counts])))


@pytest.mark.parametrize(
    ("order", "shards", "begun", "message"),
    [
        ("sorted", 1, None, "order sorted.*blocks:SEED"),
        ("blocks:1", 2, None, "each shard"),
        ("blocks:1", 1, {"stopping_rule": "strata:0.1"}, "level=0.05.* strata:0.1"),
    ],
)
def test_a_run_on_which_it_cannot_decide_is_refused(
    order: str, shards: int, begun: Json | None, message: str
) -> None:
    rule = parse_rule("strata").rule
    with pytest.raises(OptionError, match=message):
        rule.check(Declared(Order.parse(order), (), shards, begun))
    assert rule.check(Declared(Order.parse("blocks:1"), (), 1, {"stopping_rule": "strata:0.05"})) is None


@pytest.mark.parametrize("level", ["0", "0.6", "much"])
def test_it_needs_a_level(level: str) -> None:
    with pytest.raises(ValueError, match="strata:LEVEL"):
        parse_rule(f"strata:{level}")


def test_it_stops_at_what_cancels_out_over_all_pairs() -> None:
    """Every pair of one event is lost, every pair of another gained."""
    planned = plan()
    lost, gained = planned[0].event, next(pair.event for pair in planned if pair.event != planned[0].event)
    pairs: list[Pair] = [record_of(pair, pair.event != gained, pair.event != lost) for pair in planned]
    stopped = decision("strata:0.5", planned, pairs)
    assert stopped is not None
    assert stopped.at is not None
    assert stopped.at < len(planned)
    assert decision("anytime:0.5", planned, pairs) is None
    assert decision("strata:0.0001", planned, pairs) is None
