"""Common Test Report Format (ctrf.io): a test for each planned pair and each gate."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from datetime import datetime

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.gate_text import gate_lines
from pytest_libero_max.report.gates import GateResult
from pytest_libero_max.report.writers.junit import PREFIX, properties
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.runs.replay_command import replay_command, replay_text
from pytest_libero_max.runs.store import StoredRun

_STATUSES = ("passed", "failed", "skipped", "pending", "other")
_OF_GATE = {"passed": "passed", "failed": "failed", "undecidable": "skipped"}


def text(run: StoredRun, gates: Sequence[GateResult]) -> str:
    """Return the report in JSON.

    As in pytest, a measured pair passes whatever its outcome, and a pair that could not be measured fails.
    One that the policy declares not to support is skipped, and one that was not played is pending. A run
    does not record when it ended: ``stop`` is ``start`` and the durations of all pairs.
    """
    provenance, replay = run.run.provenance, replay_command(run)
    records = {record.case_id: record for record in run.records}
    errors = {error.case_id: error for error in run.errors}
    policy = run.records[0].policy if run.records else None
    unsupported = {pair.case_id for pair in unsupported_pairs(run.run.planned, policy)}
    tests = []
    for pair in sorted(run.run.planned, key=lambda pair: pair.item_id):
        found = records.get(pair.case_id) or errors.get(pair.case_id)
        test = _test(pair, found, pair.case_id in unsupported)
        tests.append(test | {"extra": test["extra"] | {"replay": replay_text(replay, pair.item_id)}})
    tests += [_gate(result, replay) for result in gates]
    counts = Counter(test["status"] for test in tests)
    began = provenance.get("started")
    start = int(datetime.fromisoformat(began).timestamp() * 1000) if began else 0
    document = {
        "reportFormat": "CTRF",
        "specVersion": "0.0.0",
        "generatedBy": "libero-max report --export",
        "results": {
            "tool": {
                "name": "pytest-libero-max",
                "version": str(provenance["versions"].get("pytest-libero-max", "unknown")),
            },
            "summary": {
                "tests": len(tests),
                **{status: counts[status] for status in _STATUSES},
                "start": start,
                "stop": start + sum(test["duration"] for test in tests),
            },
            "tests": tests,
            "environment": {
                "appName": str(provenance["policy"]["reference"]),
                "testEnvironment": str(provenance["substrate"]["name"]),
                "extra": {"cases": provenance["case_set"]["name"], "versions": provenance["versions"]},
            },
        },
    }
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _test(pair: PlannedPair, found: PairRecord | PairError | None, unsupported: bool) -> Json:
    test: Json = {
        "name": pair.item_id,
        "status": "pending",
        "duration": 0,
        "suite": ["libero-max", pair.suite],
    }
    extra = {"case_id": pair.case_id, "event": pair.event, "variant": str(pair.variant)}
    if isinstance(found, PairRecord):
        extra |= {name.removeprefix(PREFIX): value for name, value in properties(found)}
        duration = round(1000 * float(found.timings.get("pair_s", 0)))
        test |= {"status": "passed", "duration": duration, "rawStatus": found.outcome}
    elif found is not None:
        extra["phase"] = found.phase
        test |= {"status": "failed", "message": f"{found.kind}: {found.message}", "rawStatus": "error"}
    elif unsupported:
        message = f"The policy declares that it does not support {pair.suite}."
        test |= {"status": "skipped", "message": message}
    return test | {"extra": extra}


def _gate(result: GateResult, replay: Sequence[str]) -> Json:
    return {
        "name": f"gate[{result.gate.text}]",
        "status": _OF_GATE[result.verdict],
        "duration": 0,
        "suite": ["libero-max", "gates"],
        "message": "\n".join(gate_lines([result], replay)),
        "rawStatus": result.verdict,
    }
