"""Every Eval Ever (evalevalai.com): the results of a run, and a line for each arm of each measured pair."""

from __future__ import annotations

import hashlib
import json
import re
import uuid
from collections.abc import Iterator, Sequence
from datetime import datetime

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.formats import counted
from pytest_libero_max.runs.store import StoredRun
from pytest_libero_max.stats.intervals import CONFIDENCE, clopper_pearson
from pytest_libero_max.stats.ratios import Ratio

_SCHEMA = "0.3.0"
_NOT_NAMED = "unknown"


def files(run: StoredRun) -> dict[str, str]:
    """Return the two files of a run: its rates by arm, and its instances by item id in the order of the arms.

    A pair that could not be measured has no instance, because each has to have a score; gates have no place.
    The name of the files follows from the instances, so that the same run has the same files.

    Raises:
        ReportError: No pair was measured: the format has no file without an instance.
    """
    records = sorted(run.records, key=lambda record: record.item_id)
    if not records:
        raise ReportError("No pair of this run was measured, and Every Eval Ever has no run without one.")
    text = "".join(f"{json.dumps(line, allow_nan=False)}\n" for one in records for line in _lines(run, one))
    digest = hashlib.sha256(text.encode())
    name = uuid.UUID(bytes=digest.digest()[:16], version=4)
    folders = (re.sub(r"[^A-Za-z0-9._-]+", "-", part) for part in _developer_and_model(records[0]))
    path = f"data/libero-max/{'/'.join(folders)}/{name}"
    instances = f"{path}_samples.jsonl"
    detailed = {
        "format": "jsonl",
        "file_path": instances,
        "hash_algorithm": "sha256",
        "checksum": digest.hexdigest(),
        "total_rows": text.count("\n"),
    }
    whole = _whole(run, records) | {"detailed_evaluation_results": detailed}
    return {f"{path}.json": json.dumps(whole, indent=1, allow_nan=False) + "\n", instances: text}


def _whole(run: StoredRun, records: Sequence[PairRecord]) -> Json:
    provenance, policy = run.run.provenance, records[0].policy
    began = provenance.get("started")
    moment = f"{datetime.fromisoformat(began).timestamp():.0f}" if began else "0"
    details = {key: str(policy[key]) for key in ("horizon", "query_interval", "privileged")}
    details |= dict.fromkeys(("deployment_type", "model_availability"), _NOT_NAMED)
    return {
        "schema_version": _SCHEMA,
        "evaluation_id": _evaluation(run, records[0]),
        "evaluation_timestamp": moment,
        "retrieved_timestamp": moment,
        "source_metadata": {
            "source_name": "LIBERO-MAX",
            "source_type": "evaluation_run",
            "source_organization_name": _NOT_NAMED,
            "evaluator_relationship": "other",
        },
        "eval_library": {
            "name": "pytest-libero-max",
            "version": str(provenance["versions"].get("pytest-libero-max", _NOT_NAMED)),
        },
        "model_info": {
            "name": policy["name"],
            "id": policy["name"],
            "developer": _developer_and_model(records[0])[0],
            "additional_details": details,
        },
        "evaluation_results": [_result(run, records, arm) for arm in records[0].arms],
    }


def _result(run: StoredRun, records: Sequence[PairRecord], arm: str) -> Json:
    provenance = run.run.provenance
    scores = [bool(record.arms[arm].success) for record in records if arm in record.arms]
    return {
        "evaluation_name": _name(run, arm),
        "source_data": {
            "dataset_name": provenance["case_set"]["name"],
            "source_type": "other",
            "additional_details": {
                "digest": provenance["case_set"]["digest"],
                "substrate": provenance["substrate"]["name"],
            },
        },
        "metric_config": {
            "evaluation_description": f"Success rate in arm {arm} over {counted(len(scores), 'pair')}.",
            "metric_name": "success rate",
            "lower_is_better": False,
            "score_type": "continuous",
            "min_score": 0.0,
            "max_score": 1.0,
        },
        "score_details": {
            "score": sum(scores) / len(scores),
            "uncertainty": _interval(run, scores) | {"num_samples": len(scores)},
        },
    }


def _interval(run: StoredRun, scores: Sequence[bool]) -> Json:
    """Return the interval of a rate; empty where a rule stopped the run, which no interval is for."""
    interval = clopper_pearson(Ratio(sum(scores), len(scores)))
    if interval is None or run.stopped_by_rule:
        return {}
    return {
        "confidence_interval": {
            "lower": interval.lower,
            "upper": interval.upper,
            "confidence_level": CONFIDENCE,
            "method": "Clopper-Pearson",
        }
    }


def _developer_and_model(record: PairRecord) -> tuple[str, str]:
    """Return the two parts of a policy's name such as ``openvla/openvla-7b``; others name no developer."""
    developer, _, model = str(record.policy["name"]).rpartition("/")
    return developer or _NOT_NAMED, model or _NOT_NAMED


def _evaluation(run: StoredRun, record: PairRecord) -> str:
    started = run.run.provenance.get("started") or _NOT_NAMED
    return f"libero-max {run.run.provenance['case_set']['name']}/{record.policy['name']}/{started}"


def _name(run: StoredRun, arm: str) -> str:
    return f"libero-max {run.run.provenance['case_set']['name']} {arm}"


def _lines(run: StoredRun, record: PairRecord) -> Iterator[Json]:
    provenance = run.run.provenance
    for name, arm in record.arms.items():
        yield {
            "schema_version": _SCHEMA,
            "evaluation_id": _evaluation(run, record),
            "model_id": record.policy["name"],
            "evaluation_name": _name(run, name),
            "sample_id": record.item_id,
            "interaction_type": "agentic",
            "input": {"raw": record.instruction, "reference": []},
            "output": None,
            "messages": [{"turn_idx": 0, "role": "user", "content": record.instruction}],
            "answer_attribution": [],
            "evaluation": {
                "score": float(arm.success),
                "is_correct": arm.success,
                "num_turns": max(arm.queries, 1),
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
