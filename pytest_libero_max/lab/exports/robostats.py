"""robostats (github.com/JamesGongYC/robostats): the lines that its recorder writes, one for each arm."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.gates import GateResult
from pytest_libero_max.runs.store import StoredRun

_SCHEMA = 2


def text(run: StoredRun, gates: Sequence[GateResult]) -> str:
    """Return the lines in JSON, by item id and in the order of the arms.

    ``policy_id`` is the policy's name and the arm, and ``scenario_id`` the same in all arms of a case, so
    that ``pair`` joins Base with Dynamic, or an arm of two runs. A pair that could not be measured has no
    line; gates have no place.
    """
    tasks = {pair.case_id: pair.task for pair in run.run.planned}
    started = run.run.provenance.get("started")
    records = sorted(run.records, key=lambda record: record.item_id)
    lines = (line for record in records for line in _lines(record, tasks[record.case_id], started))
    return "".join(f"{json.dumps(line, sort_keys=True, allow_nan=False)}\n" for line in lines)


def _lines(record: PairRecord, task: str, started: str | None) -> Iterator[Json]:
    for name, arm in record.arms.items():
        yield {
            "schema_version": _SCHEMA,
            "policy_id": f"{record.policy['name']}/{name}",
            "task_id": task,
            "success": arm.success,
            "scenario_id": f"{record.case_id}/{record.case_digest}",
            "scenario_spec": ["case_id", "case_digest"],
            "episode_idx": None,
            "seed": record.policy_seed,
            "success_detail": None,
            "run_id": started,
            "source": None,
        }
