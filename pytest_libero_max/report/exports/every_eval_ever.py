"""Every Eval Ever (evalevalai.com): the instance-level file, a line for each arm of each measured pair."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.gates import GateResult
from pytest_libero_max.runs.store import StoredRun

_SCHEMA = "0.3.0"


def text(run: StoredRun, gates: Sequence[GateResult]) -> str:
    """Return the lines in JSON, by item id and in the order of the arms.

    A pair that could not be measured has no line, because each has to have a score; gates have no place.
    The file of aggregate results, which ``evaluation_id`` refers to, is not written.
    """
    records = sorted(run.records, key=lambda record: record.item_id)
    return "".join(f"{json.dumps(line, allow_nan=False)}\n" for one in records for line in _lines(run, one))


def _lines(run: StoredRun, record: PairRecord) -> Iterator[Json]:
    provenance = run.run.provenance
    cases, model = provenance["case_set"]["name"], record.policy["name"]
    for name, arm in record.arms.items():
        yield {
            "schema_version": _SCHEMA,
            "evaluation_id": f"libero-max {cases}/{model}/{provenance.get('started') or 'unknown'}",
            "model_id": model,
            "evaluation_name": f"libero-max {cases} {name}",
            "sample_id": record.item_id,
            "interaction_type": "agentic",
            "input": {"raw": record.instruction, "reference": []},
            "output": None,
            "messages": [{"turn_idx": 0, "role": "user", "content": record.instruction}],
            "answer_attribution": [],
            "evaluation": {
                "score": float(arm.success),
                "is_correct": arm.success,
                "num_turns": max(arm.queries or 1, 1),
            },
            "metadata": _metadata(record, name, arm, provenance["substrate"]["name"]),
        }


def _metadata(record: PairRecord, name: str, arm: ArmRecord, substrate: str) -> dict[str, str]:
    values = {
        "arm": name,
        "case_digest": record.case_digest,
        "event": record.event,
        "variant": record.variant,
        "family": record.family,
        "suite": record.suite,
        "source": record.source,
        "substrate": substrate,
        "policy_seed": record.policy_seed,
        "steps": arm.steps,
        "event_step": arm.firings[0].step if arm.firings else None,
        "shares": arm.shares,
    }
    return {key: str(value) for key, value in values.items() if value is not None}
