"""What broke, as text: by cause and event, a part of it by name; and in Base where that solves little."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec import structs

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.broken import (
    ADVICE,
    Advice,
    base_title,
    broken_line,
    broken_lines,
    coloured,
    groups_of,
    next_step,
    parts_of,
)
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.cause_rules import RULES
from pytest_libero_max.report.page.report_page import broken_cards
from pytest_libero_max.report.report_document import ChangedPair, Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.junit import broken_properties
from pytest_libero_max.report.writers.summary import quiet_lines
from tests.report.made_up import PROVENANCE, plan, record_of, records_of
from tests.report.test_diagnosis_rules import stages

PAIRS = plan()


def changed(number: int, cause: str, event: str, outcome: str = "regression") -> list[ChangedPair]:
    numbers = count()
    return [
        ChangedPair(
            item_id=f"{event}-{cause}-{next(numbers):02d}",
            event=event,
            outcome=outcome,  # type: ignore[arg-type]
            cause=cause,
            sentence=f"It was {cause}.",
        )
        for _ in range(number)
    ]


MANY = [
    *changed(30, "missed_moved_target", "target_relocation"),
    *changed(2, "dropped", "camera_shift"),
    *changed(1, "dropped", "target_relocation"),
    *changed(2, "froze", "camera_shift", "change_associated_success"),
]


def report(pairs: list[ChangedPair]) -> Report:
    made = build_report(records_of(PAIRS), [], PAIRS, PROVENANCE)
    return msgspec.structs.replace(made, changed_pairs=pairs)


def test_groups_are_by_cause_and_event_large_ones_first_and_each_is_named_before_one_is_named_twice() -> None:
    groups = groups_of(MANY, "regression", most=5)
    assert [(group.cause, group.event, group.number, len(group.named)) for group in groups] == [
        ("missed_moved_target", "target_relocation", 30, 2),
        ("dropped", "camera_shift", 2, 2),
        ("dropped", "target_relocation", 1, 1),
    ]
    assert [len(group.named) for group in groups_of(MANY, "regression", most_groups=1)] == [20, 0, 0]


def test_the_lines_name_pairs_with_their_films_and_say_how_to_see_the_rest() -> None:
    film = {"camera_shift-dropped-01": "run/films/one.mp4"}
    lines = broken_lines(report(MANY), film)
    assert lines[1].startswith("What broke: 33 of ")
    assert lines[2].startswith("30 x missed_moved_target, target_relocation; ")
    assert lines[2].endswith(MANY[0].sentence)
    assert "R   camera_shift-dropped-01  filmed" in lines
    assert lines[-1].startswith("Films: run/films; libero-max view run")
    assert sum(line.startswith("R   ") for line in lines) == 14
    assert any("report.html has 19 more" in line for line in lines)
    assert sum(line.startswith("G   ") for line in lines) == 2
    assert not any("libero-max film" in line for line in lines)
    assert "--libero-max-film=all -k target_relocation" in broken_lines(report(MANY))[-1]
    assert broken_lines(report([])) == []


def test_a_quiet_run_says_it_in_one_line() -> None:
    said = "What broke: 33 lost (missed_moved_target 30, dropped 3), 2 gained"
    assert broken_line(report(MANY)) == said
    assert quiet_lines(report(MANY), ["run/pairs.jsonl", "run/report.html"])[1:] == [
        said,
        "Written: run/report.html",
    ]


def test_markdown_has_a_table_of_those_that_broke_and_one_of_those_gained() -> None:
    text = markdown(report(MANY), {"camera_shift-dropped-01": "films/one.mp4"})
    row = "| R | `camera_shift-dropped-01` | camera_shift | dropped (2) | It was dropped. | [film]"
    assert f"{row}(films/one.mp4) |" in text
    assert text.count("| R | ") == 20
    assert "report.json have 13 more." in text
    assert text.count("| G | ") == 2
    assert "Film |" not in markdown(report(MANY))


@pytest.mark.parametrize("colours", [True, False])
def test_lost_is_red_and_gained_is_green(colours: bool) -> None:
    lines = ["What broke", "R   one", "G   two", "gate FAIL  dynamic_sr"]
    text = coloured(lines, colours)
    red, green, end = ("\x1b[31m", "\x1b[32m", "\x1b[0m") if colours else ("", "", "")
    assert text == f"What broke\n{red}R   one{end}\n{green}G   two{end}\n{red}gate FAIL  dynamic_sr{end}"


def test_a_group_of_pairs_that_play_a_program_names_it() -> None:
    (pair,) = changed(1, "grasp_slipped", "camera_shift")
    named = msgspec.structs.replace(pair, item_id="plus-object-t01-i02-camera_shift-v1-slip")
    assert (pair.program, named.program) == ("", "slip")
    lines = broken_lines(report([named]))
    assert f"1 x grasp_slipped, camera_shift (program slip): {pair.sentence}" in lines
    assert "| camera_shift (program slip) |" in markdown(report([named]))
    ((_, text),) = broken_properties([named])
    assert ", camera_shift (program slip), grasp_slipped: " in text


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
