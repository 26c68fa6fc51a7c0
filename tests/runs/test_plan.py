from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs.plan import PlannedPair, Run
from tests.report.made_up import PROVENANCE, plan


def test_every_case_is_of_one_of_the_forty_tasks_also_where_its_source_numbers_variations() -> None:
    pairs = [PlannedPair.of(case) for case in load_track("lite")]
    tasks = Counter(pair.task for pair in pairs if pair.source == "plus")
    assert {*tasks} == {
        f"{suite}/{number}" for suite in {pair.suite for pair in pairs} for number in range(10)
    }
    assert len({pair.task for pair in pairs}) == 40
    assert max(tasks.values()) < 40


def test_a_case_whose_name_says_no_task_is_of_an_unknown_one_of_its_suite() -> None:
    case = next(case for case in load_track("lite") if case.source == "plus")
    nameless = replace(case, record={**case.record, "task_name": "another_task_table_1"})
    assert PlannedPair.of(nameless).task == f"{case.suite}/?"


def test_a_plan_that_does_not_name_its_tasks_is_read() -> None:
    values = Run(tuple(plan()), PROVENANCE).to_dict()
    for pair in values["planned"]:
        del pair["task"]
    assert {pair.task for pair in Run.from_dict(values).planned} == {"libero_spatial/?"}
    del values["planned"][0]["event"]
    with pytest.raises(ReportError, match="lacks event"):
        Run.from_dict(values)
