"""The simulations behind reports/sequential.md, and a small part of the page made again."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.report.stopping_rule import BIAS
from pytest_libero_max.report.stopping_rules.anytime import Anytime
from pytest_libero_max.stats.sequential import TotalSequence, log_evidence_of_change
from pytest_libero_max.stats.significance import mcnemar
from tests.report.sequential import (
    EFFECTS,
    GATED,
    HEAD,
    LEVEL,
    LIMIT,
    NULLS,
    PUBLISHED,
    SUMS,
    above,
    below,
    bias_row,
    certain,
    change_found,
    fixed_test_peeked,
    gate_row,
    miss_row,
    null_row,
    orders,
    replay_row,
    shares,
)

PAGE = (Path(__file__).parents[2] / "reports" / "sequential.md").read_text(encoding="utf-8")


def table_of(title: str) -> list[list[str]]:
    section = PAGE.split(f"## {title}\n")[1].split("\n## ")[0]
    return [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("|")][2:]


def test_the_page_has_the_rows_of_the_code() -> None:
    assert PAGE.startswith(HEAD)
    for title, cells in (
        ("Without a change: how often one is found", NULLS),
        ("With a change: how often it is found, and when", EFFECTS),
        ("What a stopped run estimates", EFFECTS),
        ("The interval: how often it misses at any look", SUMS),
        ("A gate with a margin: `delta >= -5%`", GATED),
    ):
        assert [row[0] for row in table_of(title)] == [shares(*cell) for cell in cells]


def test_the_published_errors_are_at_most_the_level() -> None:
    errors = [
        row[column] for row in table_of("Without a change: how often one is found") for column in (1, 3)
    ]
    errors += [row[1] for row in table_of("The interval: how often it misses at any look")]
    errors += [row[3] for row in table_of("A gate with a margin: `delta >= -5%`")]
    assert all(float(error.rstrip("%")) <= 100 * LEVEL for error in errors)


def test_few_runs_err_as_rarely() -> None:
    found = null_row(0.15, 0.15, 400)
    assert float(found[1].rstrip("%")) < 100 * LEVEL < float(found[2].rstrip("%"))
    assert float(miss_row(0.15, 0.02, 1000)[1].rstrip("%")) <= 100 * LEVEL
    _, change, verdict, wrong, *_ = gate_row(0.25, 0.01, 100)
    assert (change, verdict, wrong) == ("-24.0 pp", "fails", "0.0%")


def test_reports_of_stopped_runs_name_the_published_size_of_their_bias() -> None:
    rows = {row[0]: row for row in table_of("What a stopped run estimates")}
    told = re.findall(r"-\d+\.\d", BIAS)
    assert told == [rows[name][place].split()[0] for place in (1, 3) for name in ("10% / 5%", "15% / 5%")]
    few = bias_row(0.15, 0.05, 400)
    assert float(few[3].split()[0]) == pytest.approx(float(told[3]), abs=1.5)


def test_the_simulated_rules_are_those_of_runs() -> None:
    runs = orders(0.2, 0.05, 3, 120, np.random.default_rng(4))
    for run in runs:
        sequence, losses, gains = TotalSequence(120, LEVEL, -1), 0, 0
        stops = {"below": math.inf, "above": math.inf, "change": math.inf, "fixed": math.inf}
        for place, number in enumerate(run.tolist(), 1):
            sequence.add(number)
            losses, gains = losses + (number < 0), gains + (number > 0)
            now = {
                "below": sequence.least > -30,
                "above": sequence.most < -5,
                "change": log_evidence_of_change(losses, gains) >= -math.log(LEVEL),
                "fixed": 10 ** mcnemar(losses, gains) <= LEVEL,
            }
            stops = {name: min(stops[name], place if met else math.inf) for name, met in now.items()}
        simulated = (
            below(run[None], -30),
            above(run[None], -5),
            change_found(run[None]),
            fixed_test_peeked(run[None]),
        )
        assert [float(found[0]) for found in simulated] == [*stops.values()]
        assert certain(run[None])[0] <= 120
    assert LIMIT < 0


@pytest.mark.parametrize("policy", PUBLISHED)
def test_a_published_run_is_stopped_where_the_page_says(policy: str) -> None:
    row = replay_row(policy, "base_sr >= 80%", "anytime:0.05", [1])
    (published,) = (
        line
        for line in table_of("Published runs")
        if line[:3] == [policy, "`base_sr >= 80%`", "`anytime:0.05`"]
    )
    least, most = map(int, published[5].split(" to "))
    assert least <= int(row[4]) <= most
    assert row[3].split()[0] in published[3]


def test_the_level_is_that_of_the_rule() -> None:
    assert Anytime("").level == LEVEL
