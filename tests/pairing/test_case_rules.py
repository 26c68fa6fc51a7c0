"""A record that contradicts its case is refused, wherever it meets the manifest."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import ReportError
from pytest_libero_max.films.recorded import RecordedRun
from pytest_libero_max.pairing.case_rules import require_of_case
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.runs.agreement import Agreement
from pytest_libero_max.runs.store import PAIRS_NAME, PairStore, read_pairs, read_to_resume

RUN = read_pairs(Path(__file__).parents[2] / "reports" / "smoke" / "expert")
CASES = {case.case_id: case for case in load_track("smoke").cases}
RECORD = next(record for record in RUN.records if record.triggered)
CASE = replace(CASES[RECORD.case_id], instruction=RECORD.instruction)


def _dynamic(values: Json) -> Json:
    dynamic: Json = values["arms"]["dynamic"]
    return dynamic


def _event(values: Json) -> Json:
    event: Json = _dynamic(values)["schedule"][0]
    return event


FORGERIES: dict[str, Callable[[Json], Any]] = {
    "policy_seed": lambda values: values.update(policy_seed=values["policy_seed"] + 1),
    "init_state_index": lambda values: values.update(init_state_index=values["init_state_index"] + 1),
    "task_index": lambda values: values.update(task_index=values["task_index"] + 1),
    "instruction": lambda values: values.update(instruction="do nothing"),
    "trigger_entity": lambda values: values.update(trigger_entity="another_1"),
    "arms.dynamic.repetition": lambda values: _dynamic(values).update(repetition=3),
    "arms.base.repetition": lambda values: values["arms"]["base"].update(repetition=1),
    "arms.dynamic.schedule[0].change": lambda values: _dynamic(values)["schedule"][0].update(
        change={"operation": "nothing"}
    ),
    "arms.dynamic.schedule[0].trigger.type": lambda values: _event(values)["trigger"].update(type="at_start"),
}
"""Changes of a record, by the field that an error names."""


def _forged(forge: Callable[[Json], Any]) -> PairRecord:
    values = RECORD.to_dict()
    forge(values)
    return PairRecord.from_dict(values)


@pytest.mark.parametrize(("field", "forge"), FORGERIES.items(), ids=FORGERIES)
def test_a_record_that_contradicts_its_case_is_refused(
    field: str, forge: Callable[[Json], Any], tmp_path: Path
) -> None:
    forged = _forged(forge)
    with pytest.raises(ReportError, match=re.escape(field)):
        require_of_case(forged, CASE)
    PairStore(tmp_path, RUN.run).close()
    with (tmp_path / PAIRS_NAME).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"line": "pair", **forged.to_dict()}) + "\n")
    stored = read_to_resume(tmp_path, {CASE.case_id: CASE})
    assert stored is not None
    assert (stored.records, [line.number for line in stored.damaged]) == ((), [2])
    assert field in str(stored.damaged[0])


@pytest.mark.parametrize(
    ("name", "value"), [("strength", "0.05"), ("strength", "much"), ("latency", "4steps")]
)
def test_a_record_has_strength_and_latency_of_its_run_or_none(name: str, value: str) -> None:
    forged = _forged(lambda values: values["fingerprints"].update({name: value}))
    with pytest.raises(ReportError, match=f"fingerprints.{name}="):
        Agreement(RUN.run).add(forged, "line 2")
    if name == "strength":
        with pytest.raises(ReportError):
            require_of_case(forged, CASE)


def test_no_film_is_of_another_case() -> None:
    forged = _forged(FORGERIES["arms.dynamic.schedule[0].change"])
    unused: Any = None
    with pytest.raises(ReportError, match="schedule"):
        RecordedRun(Path(), RUN, CASES, unused).again(forged, unused)


def test_published_records_are_of_their_cases() -> None:
    for record in RUN.records:
        require_of_case(record, CASES[record.case_id])
