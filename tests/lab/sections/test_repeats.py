"""Repeated cases, counted from made-up records."""

from __future__ import annotations

import re

import pytest
from msgspec.structs import replace

from pytest_libero_max.lab.sections.repeats import NOTE, TITLE, RepeatedCases
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.measures import Rows, measures_of
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.sections import PlayedPairs
from pytest_libero_max.stats.blocks import Measure
from tests.report.made_up import PROVENANCE, plan, record_of, stopped_rows

PAIRS = plan(per_cell=2)
PLAYED = {**PROVENANCE, "protocol": {"prefix": "fork", "study": {"name": "repeats"}}}


def repeated(number: int, *ends: tuple[bool, bool], alike: bool = False) -> PairRecord:
    """A case whose plays end like this in Base and in Dynamic."""
    record = record_of(PAIRS[number], *ends[0])
    arms = dict(record.arms)
    for play, (base, dynamic) in enumerate(ends[1:], 2):
        for name, success in (("base", base), ("dynamic", dynamic)):
            arm = record.arms[name]
            proof = arm.proof if alike else f"{play:064x}"
            arms[f"{name}_{play}"] = replace(arm, success=success, proof=proof)
    return replace(record, arms=arms)


def rows(records: list[PairRecord]) -> Rows:
    return RepeatedCases().tables(PlayedPairs(records, protocol=PLAYED["protocol"]))[TITLE]


def measures(records: list[PairRecord]) -> dict[str, Measure]:
    """The numbers by the ends of their keys, after ``repeats.``."""
    return {key.removeprefix("repeats."): one for key, one in measures_of({TITLE: rows(records)}).items()}


KEPT, LOST, GAINED, FAILED = (True, True), (True, False), (False, True), (False, False)


def test_a_case_is_one_unit_with_a_probability_of_a_regression() -> None:
    records = [
        repeated(0, LOST, KEPT, LOST),
        repeated(1, KEPT, KEPT, KEPT),
        repeated(2, FAILED, GAINED, KEPT),
    ]
    table, found = rows(records), measures(records)
    assert (table["Cases"], table["Plays of each"]) == (3, 3)
    assert found["change"].value == pytest.approx(-1 / 9)
    assert re.findall(r"\d+", found["change"].lack) == ["2", "10"]
    assert found["regression"].value == pytest.approx(2 / 9)
    assert table[f"... {PAIRS[0].item_id}"] == "2/3 plays"
    assert f"... {PAIRS[2].item_id}" not in table
    assert found["flips"].value == pytest.approx(1 / 3)
    assert found["flips_beyond_seeds"].value == pytest.approx((2 / 6 + 0 + 0) / 3)


def test_more_plays_of_the_same_ends_narrow_nothing() -> None:
    ends = [LOST, KEPT, KEPT, GAINED, LOST, KEPT] * 5
    twice, often = (measures([repeated(n, *[end] * k) for n, end in enumerate(ends)]) for k in (2, 8))
    assert twice["change"] == often["change"]
    assert twice["change"].lower is not None
    stopped = stopped_rows(rows([repeated(n, end, end) for n, end in enumerate(ends)]))
    assert measures_of({TITLE: stopped})["repeats.change"].lower is None


def test_a_policy_that_ignores_its_seeds_is_told_so() -> None:
    records = [repeated(n, LOST, LOST, LOST, alike=True) for n in range(4)]
    found = measures(records)
    assert (found["differing"].count, found["differing"].of) == (0, 16)
    assert "What the repeats bought" in rows(records)
    assert "change" not in found


def test_it_is_a_section_of_the_study_and_the_headline_stays_that_of_pairs() -> None:
    records = [repeated(n, KEPT, LOST, LOST) for n in range(6)]
    report = build_report(records, [], PAIRS[:6], PLAYED)
    text = markdown(report)
    assert f"## {TITLE}\n" in text
    assert NOTE in text
    assert (report.overall.played, report.overall.paired_change.value) == (6, 0.0)
    assert report.study is not None
    assert (report.study.arms or {})["dynamic_2"].count == 0
    assert TITLE not in build_report(records[:0], [], PAIRS[:6], PLAYED).sections


def test_a_run_of_repeats_has_no_table_of_an_audit() -> None:
    records = [repeated(0, LOST, KEPT), repeated(1, KEPT, KEPT)]
    text = markdown(build_report(records, [], PAIRS[:2], PLAYED))
    assert "without an input" not in text
    assert "| dynamic_2 | 100.0%" in text
