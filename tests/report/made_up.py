"""Made-up pairs: no simulator is needed to test what is computed from records."""

from __future__ import annotations

import base64
import gzip
import json
import os
import random
import re
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import msgspec
from msgspec import structs

from pytest_libero_max.benchmark.cases import step_budget
from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, EVENTS
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC
from pytest_libero_max.pairing.record import RECORD_VERSION, PairError, PairRecord
from pytest_libero_max.report.measures import Rows
from pytest_libero_max.report.report_document import PlayedSelection
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import PairStore, StoredRun
from pytest_libero_max.stats.blocks import Block, Measure
from pytest_libero_max.stats.measured import without_intervals

POLICY: Json = {
    "name": "scripted",
    "horizon": 10,
    "query_interval": 5,
    "cameras": ["agentview"],
    "image_size": 256,
    "privileged": False,
}

PROVENANCE: Json = {
    "versions": {"python": "3.11.0", "pytest-libero-max": "0.1.0"},
    "platform": {"system": "Linux", "machine": "x86_64", "libc": "2.36"},
    "gl_backend": "egl",
    "git": None,
    "substrate": {"name": "embedded", "images": "2"},
    "case_set": {"name": "track smoke", "digest": "0" * 64},
    "policy": {"reference": "scripted.py", "horizon": None, "query_interval": None},
    "protocol": {"prefix": "fork"},
    "command": ["pytest"],
}


def plan(per_cell: int = 1, sources: tuple[str, ...] = ("plus", "pro")) -> list[PlannedPair]:
    """Planned pairs: ``per_cell`` of them for every event, variant and source."""
    pairs = []
    kinds = [(name, EVENTS[name]) for name in BENCHMARK_EVENTS]
    for source, (name, kind), variant, index in product(sources, kinds, (0, 1), range(per_cell)):
        item = f"{source}-spatial-t{index:02d}-{name}-v{variant}"
        pairs.append(
            PlannedPair(
                case_id=item,
                item_id=item,
                case_digest=canonical_digest(item),
                source=source,
                source_category="Camera Viewpoints" if source == "plus" else "Position",
                difficulty=3 if source == "plus" else None,
                suite="libero_spatial" if index % 2 == 0 else "libero_object",
                event=name,
                family=kind.family,
                variant=variant,
                severity=kind.severities[variant],
                task=f"libero_{'spatial' if index % 2 == 0 else 'object'}/{index % 10}",
            )
        )
    return pairs


def plain(document: Block) -> Json:
    """A report or comparison as ``json.loads`` reads it from its file."""
    values: Json = msgspec.to_builtins(document)
    return values


def page_cases(page: str) -> Json:
    """The data of the table of cases in a page, as its script reads them."""
    (data,) = re.findall(r"id='cases-data'>(.*?)</script>", page, re.S)
    parts = re.findall(r"class='details-data'>(.*?)</script>", page, re.S)
    values: Json = _unpacked(data)
    return {**values, "details": [details for part in parts for details in _unpacked(part)]}


def _unpacked(data: str) -> Any:
    return json.loads(gzip.decompress(base64.b64decode(data, validate=True)))


def selected(whole: bool) -> PlayedSelection:
    """A selection of all cases of the track smoke, or of all but one."""
    return PlayedSelection(
        asked=[],
        chosen=32 if whole else 31,
        of=32,
        digest="0" * 64,
        shards=None,
        merged=False,
        whole=whole,
        missing_shards=[],
        text="cases",
    )


def record_of(pair: PlannedPair, base: bool, dynamic: bool, **changes: Any) -> PairRecord:
    """A record of a planned pair with the outcomes given.

    Args:
        pair: The planned pair.
        base: Success in Base.
        dynamic: Success in Dynamic.
        changes: Fields of the record; values of its Base, event and Dynamic as in :data:`_ARMS`; and
            ``base_repeat``, the success of a second play of Base and whether it was identical.
    """
    labels = structs.asdict(pair)
    del labels["task"]
    arms = {**_ARMS, "base_success": base, "dynamic_success": dynamic}
    arms |= {name: changes.pop(name) for name in _ARMS if name in changes}
    repeat: Json | None = changes.pop("base_repeat", None)
    values: dict[str, Any] = {
        **labels,
        "task_index": 0,
        "init_state_index": 0,
        "policy_seed": 195,
        "instruction": "put the bowl on the plate",
        "trigger_entity": "bowl_1",
        "max_steps": step_budget(pair.suite) or 220,
        "policy": POLICY,
        "fingerprints": {"substrate": "embedded"},
        "timings": {"pair_s": 1.25},
        "arms": _arms(arms, repeat),
    }
    return PairRecord.from_dict({"schema_version": RECORD_VERSION, **values, **changes})


_ARMS: Json = {
    "base_success": True,
    "dynamic_success": True,
    "base_steps": 90,
    "dynamic_steps": 95,
    "trigger_step": 23,
    "trigger_distance_m": 0.178,
    "min_distance_m": 0.01,
    "response_step": 25,
    "stale_actions": 2,
    "base_queries": 18,
    "dynamic_queries": 14,
    "prefix_digest": "ab" * 32,
    "base_digest": "cd" * 32,
    "dynamic_digest": "ef" * 32,
    "evidence": {
        "operation": "made_up",
        "factors": [],
        "before": {},
        "after": {},
        "pixel_change": {"agentview": 3.5},
    },
    "contacts": {"base": ["plate_1"], "dynamic": []},
}


def _arms(flat: Json, repeat: Json | None) -> Json:
    base = {
        "schedule": [],
        "repetition": 0,
        "success": flat["base_success"],
        "steps": flat["base_steps"],
        "queries": flat["base_queries"],
        "firings": [],
        "response_step": None,
        "stale_actions": None,
        "min_distance_m": flat["min_distance_m"],
        "clipped_components": 0,
        "contacts": flat["contacts"]["base"],
        "proof": flat["base_digest"],
        "shares": None,
    }
    event = {"trigger": {"type": "proximity"}, "change": {"operation": "made_up"}}
    dynamic = {**base, "schedule": [event], "shares": BASE}
    if flat["trigger_step"] is not None:
        before = -(-flat["trigger_step"] // POLICY["query_interval"])
        dynamic |= {
            "success": flat["dynamic_success"],
            "steps": flat["dynamic_steps"],
            "queries": before + flat["dynamic_queries"],
            "firings": [
                {
                    "step": flat["trigger_step"],
                    "queries": before,
                    "distance_m": flat["trigger_distance_m"],
                    "prefix_proof": flat["prefix_digest"],
                    "evidence": flat["evidence"],
                }
            ],
            "response_step": flat["response_step"],
            "stale_actions": flat["stale_actions"],
            "contacts": flat["contacts"]["dynamic"],
            "proof": flat["dynamic_digest"],
            "shares": None,
        }
    arms = {BASE: base, DYNAMIC: dynamic}
    if repeat is not None:
        proof = base["proof"] if repeat["identical"] else "12" * 32
        arms[BASE_AGAIN] = {**base, "repetition": 1, "success": repeat["success"], "proof": proof}
    return arms


NEVER_TRIGGERED: Json = {
    "trigger_step": None,
    "trigger_distance_m": None,
    "response_step": None,
    "stale_actions": None,
    "dynamic_queries": 0,
    "prefix_digest": None,
    "dynamic_digest": None,
    "evidence": None,
}


def records_of(pairs: Sequence[PlannedPair], seed: int = 0) -> list[PairRecord]:
    """Records with outcomes drawn at about 70% in Base and 50% in Dynamic."""
    draw = random.Random(seed)
    return [record_of(pair, draw.random() < 0.7, draw.random() < 0.5) for pair in pairs]


def run_of(
    planned: Sequence[PlannedPair],
    records: Iterable[PairRecord],
    provenance: Json = PROVENANCE,
    errors: Iterable[PairError] = (),
) -> StoredRun:
    """A run as it is read from its file."""
    return StoredRun(Run(tuple(planned), provenance), tuple(records), tuple(errors), torn=False)


def write_run(folder: Path, run: StoredRun) -> Path:
    """Write the pairs of a run, and return its folder."""
    pairs: list[PairRecord | PairError] = [*run.errors, *run.records]
    store = PairStore(folder, run.run)
    for pair in pairs:
        store.append(pair)
    store.close(run.stopped)
    return folder


def error_of(pair: PlannedPair) -> PairError:
    """A pair that could not be measured."""
    return PairError(
        case_id=pair.case_id,
        item_id=pair.item_id,
        case_digest=pair.case_digest,
        kind="SimulatorError",
        message="qpos is not finite",
        phase="dynamic",
    )


def kill(store: PairStore) -> None:
    """Leave what a kill leaves: the files, without their lock."""
    assert store._file is not None
    assert store._mark is not None
    store._file.close()
    os.close(store._mark._descriptor)


def stopped_rows(rows: Rows) -> Rows:
    """The rows of a section as the report of a run has them that a rule has stopped: without intervals."""
    return {
        name: without_intervals(value) if isinstance(value, Measure) else value
        for name, value in rows.items()
    }
