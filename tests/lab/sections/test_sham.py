"""Flips beyond a policy's own chance, estimated without bias."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from msgspec.structs import replace
from scipy import stats

from pytest_libero_max.lab.sections.sham import TITLE, Sham, chance_rows
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.gates import evaluate_gate, parse_gate
from pytest_libero_max.report.measures import measures_of
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import PlayedPairs
from pytest_libero_max.report.writers.power_text import chance_of, expectations_of
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.stats.blocks import Measure
from tests.report.made_up import PROVENANCE, plan, records_of

FOUR = ("base", "dynamic", "sham", "sham_dynamic")


def played(ends: Iterable[Sequence[bool]]) -> list[Any]:
    """Pairs that end like this in the four rollouts."""
    return [
        SimpleNamespace(
            base_success=row[0],
            dynamic_success=row[1],
            arms={
                name: SimpleNamespace(success=bool(end), proof=name)
                for name, end in zip(FOUR, row, strict=True)
            },
        )
        for row in ends
    ]


def chance(ends: Iterable[Sequence[bool]]) -> dict[str, Measure]:
    """The flips by chance, by the name that gates use."""
    return measures_of({TITLE: chance_rows(played(ends))})


@pytest.mark.parametrize(("base", "dynamic"), [(0.5, 0.5), (0.9, 0.2), (1.0, 0.0), (0.8, 0.6)])
def test_flips_less_the_floor_are_the_square_of_the_effect(base: float, dynamic: float) -> None:
    found = chance(np.random.default_rng(1).random((20_000, 4)) < (base, dynamic, base, dynamic))
    beyond, floor, flips = (found[f"sham.{key}"] for key in ("flips.beyond", "floor", "flips"))
    assert None not in (beyond.value, beyond.lower, beyond.upper, floor.value, flips.value)
    assert beyond.value == pytest.approx((base - dynamic) ** 2, abs=0.02)
    assert (beyond.lower or 0.0) <= (base - dynamic) ** 2 <= (beyond.upper or 1.0)
    assert floor.value == pytest.approx(base * (1 - base) + dynamic * (1 - dynamic), abs=0.02)
    assert flips.value == pytest.approx((beyond.value or 0.0) + (floor.value or 0.0), abs=0.03)


def test_nothing_is_said_of_pairs_that_were_not_played_twice() -> None:
    assert chance_rows([]) == {}


def texts(records: list[Any], *, repeatable: bool = False, asked: float | None = None) -> list[str]:
    """The warnings of a run of 40 pairs, of which these played the sham event."""
    report = SimpleNamespace(
        policy={"repeatable": repeatable},
        sections=Sham().tables(PlayedPairs(records)),
        pairs=SimpleNamespace(played=40),
        provenance={"protocol": {} if asked is None else {"sham": asked}},
    )
    return Sham().warnings(cast("Report", report))


def ended(**counts: int) -> list[Any]:
    """Pairs by the ends of Base, Dynamic, and both again, as letters: ``s`` for a success."""
    return played([letter == "s" for letter in ends] for ends, count in counts.items() for _ in range(count))


def test_a_floor_as_large_as_the_effect_is_called_so() -> None:
    _, said = texts(ended(ssss=10, sfff=3, sssf=4, sffs=3))
    assert [value for value in ("FLOOR IS AS", "20 pairs", "30.0%", "32.5%") if value not in said] == []
    _, said = texts(ended(ssss=10, sfff=8, fsss=2))
    values = ("FLOOR MAY BE", "20 pairs", "50.0%", "25.0%", "+0.0 pp [-16.8, +16.8]")
    assert [value for value in values if value not in said] == []


def test_a_smaller_floor_is_compared_and_none_of_a_policy_that_repeats_itself() -> None:
    assert texts(ended(ssss=10, sfff=8, fsss=2), repeatable=True) == []
    assert len(texts(ended(ssff=0, sfsf=30, ssss=10))) == 1
    (unknown,) = texts([])
    assert "--libero-max-noise=sham:1" in unknown
    assert "40 of 40 pairs" in texts(ended(sfsf=30, ssss=10))[0]


def test_a_sham_event_that_was_asked_for_and_not_played_is_named() -> None:
    (text,) = texts([], repeatable=True, asked=0.1)
    assert "10% of the pairs" in text
    assert texts(ended(ssss=2), repeatable=True, asked=0.1) == []


def shammed(ends: Sequence[bool]) -> Report:
    """A report of pairs of which the first ones end like this after the sham event."""
    pairs = plan(per_cell=3)
    records = records_of(pairs)
    for number, end in enumerate(ends):
        arms = records[number].arms
        records[number] = replace(
            records[number], arms={**arms, "sham": replace(arms["base"], success=end, proof="ab" * 32)}
        )
    return build_report(records, [], pairs, PROVENANCE)


def test_the_sham_event_tells_what_chance_does() -> None:
    pairs = plan(per_cell=3)
    base = [record.base_success for record in records_of(pairs)]
    report = shammed([end if number % 8 else not end for number, end in enumerate(base)])
    most, text = chance_of(report)
    changed = base[::8]
    lost, gained = changed.count(True), changed.count(False)
    assert f"the sham event: {lost} lost, {gained} gained of {len(pairs)} pairs" in text
    interval = stats.binomtest(max(lost, gained), len(pairs), alternative="less").proportion_ci(0.95)
    assert most == pytest.approx(interval.high)
    assert expectations_of(report)[0].gain == pytest.approx(most)
    assert any(line.startswith("Lost to") for line in summary_lines(report))


def test_a_gate_asks_for_what_is_beyond_the_sham_event() -> None:
    report = shammed([True] * len(plan(per_cell=3)))
    value = measures_of(report.sections)["beyond_sham"]
    verdict = evaluate_gate(parse_gate("beyond_sham.lower >= -15%"), report)
    assert (verdict.verdict, verdict.value) == ("failed", value.lower)
    assert evaluate_gate(parse_gate("beyond_sham >= -90%"), report).passed
    lack = evaluate_gate(parse_gate("beyond_sham >= -15%"), shammed([]))
    assert lack.verdict == "undecidable"
    assert "--libero-max-noise=sham:SHARE" in lack.reason
    failing = replace(report.overall, base_success=replace(report.overall.base_success, value=0.1))
    assert evaluate_gate(parse_gate("beyond_sham >= -15%"), replace(report, overall=failing)).value is None
