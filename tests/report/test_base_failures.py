"""What broke in Base: shown where Base solves little, with the next step of the table of AGENTS.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import (
    ADVICE,
    Advice,
    base_title,
    broken_line,
    broken_lines,
    next_step,
    parts_of,
)
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.cause_rules import RULES
from pytest_libero_max.report.page.broken_cards import broken_cards
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from tests.report.made_up import PROVENANCE, plan, record_of
from tests.report.test_diagnosis_rules import stages

PAIRS = plan()
AGENTS = Path(__file__).parents[2] / "AGENTS.md"


def _report(solved: int, pairs: int = 8, **columns: Any) -> Report:
    """Return the report of a run of which Base solves some pairs, and fails the others in one way."""
    records = [_record(number, number < solved, **columns) for number in range(pairs)]
    return build_report(records, [], PAIRS[:pairs], PROVENANCE)


def _record(number: int, solved: bool, **columns: Any) -> PairRecord:
    record = record_of(PAIRS[number], base=solved, dynamic=solved)
    arms = {
        name: structs.replace(arm, probes={"stages": stages(steps=arm.steps, **columns)})
        for name, arm in record.arms.items()
    }
    return structs.replace(record, arms=arms)


def test_the_table_of_agents_md_is_the_one_that_the_report_draws_from() -> None:
    text = AGENTS.read_text(encoding="utf-8")
    for row in ADVICE:
        assert f"| Base fails, {row.sight} | {row.meaning} |" in text


def test_a_cause_belongs_to_one_row_at_most_and_exists() -> None:
    causes = [cause for row in ADVICE for cause in row.causes]
    assert len(set(causes)) == len(causes)
    assert {*causes} <= {name for name, _ in RULES}


def test_base_that_solves_nothing_says_what_to_mend() -> None:
    report = _report(0, reach_m=0.01)
    assert next_step(report).startswith("Fix Base first")
    assert ADVICE[2].meaning in next_step(report)
    lines = broken_lines(report, {report.base_failures[0].item_ids[2]: "films/x.webp"})
    assert any(line.startswith("8 x not_attempted") for line in lines)
    assert f"B   {report.base_failures[0].item_ids[2]}  filmed" in lines
    assert broken_line(report) == next_step(report)
    first = report.base_failures[0].item_ids[0]
    assert broken_lines(report)[-1].endswith(f"--libero-max-film=all -k {first}")


def test_a_base_that_solves_some_is_no_wrong_adapter() -> None:
    text = next_step(_report(3, reach_m=0.01))
    assert "3 of 8 pairs" in text
    assert "Fix" not in text
    assert "its own evaluation" in text, "the next step"


def test_nothing_is_said_where_base_solves_half_or_no_record_knows() -> None:
    assert not _report(4, reach_m=0.01).base_failures
    old = build_report([record_of(PAIRS[0], base=False, dynamic=False)], [], PAIRS[:1], PROVENANCE)
    assert old.base_failures
    assert parts_of(old) == []


def test_markdown_and_page_show_it_as_well() -> None:
    report = _report(0, reach_m=0.01)
    assert f"## {base_title(report)}" in markdown(report, {})
    first = broken_cards(report, {report.base_failures[0].item_ids[0]: ["films/x.webp"]}, {})[0]
    assert first.part.title == base_title(report)
    assert first.part.note == next_step(report)
    assert first.cards[0].film == "films/x.webp"


@pytest.mark.parametrize("row", ADVICE)
def test_sights_are_clauses(row: Advice) -> None:
    assert row.sight.startswith("the hand ")
