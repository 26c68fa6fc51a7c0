"""The protocol class of a run, which every report says in one line."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.inference import inference_of
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import PROVENANCE, plan, records_of

PAIRS = plan()
RECORDS = records_of(PAIRS)
DELAYED = {
    "trigger": {"type": "at_start"},
    "change": {"operation": "delay_answers", "latency": "4steps,sync"},
}


def with_arms(**changes: Json) -> list[PairRecord]:
    """The made-up records with other fields in some arms; a name that they lack is a further Dynamic."""
    return [
        structs.replace(
            record,
            arms={
                **record.arms,
                **{
                    name: structs.replace(record.arms.get(name, record.arms["dynamic"]), **fields)
                    for name, fields in changes.items()
                },
            },
        )
        for record in RECORDS
    ]


LATE: Json = {"latency": "4steps"}


@pytest.mark.parametrize(
    ("records", "world", "words"),
    [
        (RECORDS, "paused", "world paused during inference"),
        (with_arms(base=LATE, dynamic=LATE), "goes on", "4 steps (200 ms) late, asynchronous"),
        (
            with_arms(base={"latency": "1steps,sync"}, dynamic={"latency": "1steps,sync"}),
            "goes on",
            "1 step (50 ms) late, the robot waits",
        ),
        (
            with_arms(base={"latency": "1:80+2:20steps"}, dynamic={"latency": "1:80+2:20steps"}),
            "goes on",
            "up to 2 steps (100 ms) late",
        ),
        (with_arms(dynamic_d4=LATE), "paused", "in dynamic_d4 (4 steps (200 ms)"),
        (with_arms(dynamic={"schedule": (DELAYED,)}), "goes on", "late from a change on, the robot waits"),
        (with_arms(**{f"dynamic_d{n}": LATE for n in range(6)}), "paused", "2 more arms"),
    ],
)
def test_the_class_says_what_the_world_does(records: list[PairRecord], world: str, words: str) -> None:
    inference = inference_of(records, PROVENANCE["protocol"])
    assert inference.world == world
    assert words in inference.text
    assert "\n" not in inference.text


def test_a_run_without_a_pair_says_what_was_asked_for() -> None:
    assert inference_of([], {"prefix": "fork"}).world == "paused"
    asked = inference_of([], {"latency": "4steps"})
    assert (asked.world, asked.late) == ("goes on", {"base": ["4steps"], "dynamic": ["4steps"]})


@pytest.mark.parametrize("records", [RECORDS, with_arms(base=LATE, dynamic=LATE), []])
def test_every_report_has_the_line(records: list[PairRecord]) -> None:
    report = build_report(records, [], PAIRS, PROVENANCE)
    begin = report.inference.text.partition(";")[0][:60]
    texts: list[Any] = [markdown(report), html(report, [], ["pytest"]), "\n".join(summary_lines(report))]
    assert all(text.count(begin) == 1 for text in texts)
