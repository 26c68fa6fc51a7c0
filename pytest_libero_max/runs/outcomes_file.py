"""``outcomes.json``: what a comparison needs of a run, so that it need not read every record.

The file is written beside ``pairs.jsonl`` with the reports and holds its digest; its first line is its own.
Where one of the two is another, or the file is missing, the outcomes are read from the records: the file
saves time, nothing else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.scene_fingerprints import SCENE, START
from pytest_libero_max.runs.lock import require_ended
from pytest_libero_max.runs.plan import PlannedPair, Run, planned_pair
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun, pairs_file, read_pairs
from pytest_libero_max.stats.paired import Labels, Pairs

OUTCOMES_NAME = "outcomes.json"
OUTCOMES_VERSION = 3

_PLANNED = b',"planned":['
"""Begins the last field of a run's line."""


@dataclass(frozen=True, eq=False)
class RunOutcomes:
    """A run reduced to what a comparison needs.

    Attributes:
        run: The plan and provenance.
        case_ids: Ids of the measured cases, in the order of the records.
        pairs: Their outcomes in the same order.
        policy: The spec of the first record; None without a record.
        scenes: Fingerprints of scene and start of each case, in the same order; empty where a record of an
            earlier version has none.
    """

    run: Run
    case_ids: tuple[str, ...]
    pairs: Pairs
    policy: Json | None
    scenes: tuple[str, ...]

    @classmethod
    def of(cls, stored: StoredRun) -> RunOutcomes:
        """The outcomes of a run that has been read."""
        records = stored.records
        tasks = {pair.case_id: pair.task for pair in stored.run.planned}
        return cls(
            run=stored.run,
            case_ids=tuple(record.case_id for record in records),
            pairs=columns_of(records, [tasks.get(record.case_id, "?") for record in records]),
            policy=records[0].policy if records else None,
            scenes=tuple(map(_scene_of, records)),
        )


def _scene_of(record: PairRecord) -> str:
    return " ".join(record.fingerprints.get(name, "") for name in (SCENE, START)).strip()


def columns_of(records: Sequence[PairRecord], tasks: Sequence[str]) -> Pairs:
    """The columns of the statistics, one row a record.

    Args:
        records: Measured pairs.
        tasks: The task of each, see :class:`~pytest_libero_max.runs.plan.PlannedPair`.
    """
    return Pairs.of(
        base=[record.base_success for record in records],
        dynamic=[record.dynamic_success for record in records],
        triggered=[record.triggered for record in records],
        responded=[record.responded for record in records],
        stale=[-1 if record.stale_actions is None else record.stale_actions for record in records],
        source=[record.source for record in records],
        task=tasks,
    )


def outcomes_json(outcomes: RunOutcomes, digest: str) -> str:
    """The content of ``outcomes.json``.

    Args:
        outcomes: Of the run.
        digest: Of its ``pairs.jsonl``; see :func:`file_digest`.
    """
    pairs = outcomes.pairs
    flags = {name: "".join("1" if flag else "0" for flag in getattr(pairs, name).tolist()) for name in _FLAGS}
    values = {
        "schema_version": OUTCOMES_VERSION,
        "pairs_digest": digest,
        "policy": outcomes.policy,
        "case_ids": list(outcomes.case_ids),
        **flags,
        "stale": pairs.stale.tolist(),
        "source": _coded(pairs.source),
        "task": _coded(pairs.task),
        "scenes": _coded(np.array(outcomes.scenes, dtype=str)),
    }
    text = json.dumps(values, separators=(",", ":"), allow_nan=False)
    return f"{_digest(text.encode())}\n{text}\n"


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def _coded(labels: Labels) -> Json:
    """Labels as their distinct names and the place of each among them."""
    names, places = np.unique(labels, return_inverse=True)
    return {"names": names.tolist(), "places": places.tolist()}


_DAMAGE = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RecursionError,
    ReportError,
)
"""What a file that is missing or damaged can bring about."""


def read_outcomes(path: Path) -> RunOutcomes:
    """Read the outcomes of a run.

    Args:
        path: Its folder, or its ``pairs.jsonl``.

    Raises:
        ReportError: See :func:`~pytest_libero_max.runs.store.read_pairs`.
    """
    pairs_path = pairs_file(path)
    if pairs_path.name == PAIRS_NAME:
        require_ended(pairs_path.parent)
    try:
        digest, _, text = (pairs_path.parent / OUTCOMES_NAME).read_bytes().rstrip(b"\n").partition(b"\n")
        if digest.decode() == _digest(text):  # whole, and as this package wrote it
            kept = json.loads(text)
            if kept["schema_version"] == OUTCOMES_VERSION and kept["pairs_digest"] == file_digest(pairs_path):
                return _from_file(kept, _run_of(pairs_path))
    except _DAMAGE:
        pass  # the records say all of it, and what is wrong with them
    return RunOutcomes.of(read_pairs(pairs_path))


def file_digest(path: Path) -> str:
    """BLAKE2b of a file, hexadecimal; faster than SHA-256 on most processors."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "blake2b").hexdigest()


_FLAGS = ("base", "dynamic", "triggered", "responded")


def _from_file(kept: Json, run: Run) -> RunOutcomes:
    flags = {name: np.frombuffer(kept[name].encode(), dtype=np.uint8) == ord("1") for name in _FLAGS}
    labels = {
        name: np.array(kept[name]["names"])[kept[name]["places"]] for name in ("source", "task", "scenes")
    }
    scenes = tuple(labels.pop("scenes").tolist())
    pairs = Pairs.of(**flags, stale=kept["stale"], **labels)
    if {len(column) for column in (*vars(pairs).values(), scenes)} != {len(kept["case_ids"])}:
        raise ReportError("The columns differ in length.")
    return RunOutcomes(run, tuple(kept["case_ids"]), pairs, kept["policy"], scenes)


def _run_of(path: Path) -> Run:
    """The first line of a ``pairs.jsonl``; runs of the same plan share its pairs."""
    with path.open("rb") as file:
        line = file.readline()
    head, planned, tail = line.rpartition(_PLANNED)
    if not planned:
        raise ReportError("The plan is not the last field of the run.")
    values = json.loads(head + b"}")
    values.pop("line")
    run = Run.from_dict({**values, "planned": []})
    return Run(_planned_pairs(tail.strip()), run.provenance)


@lru_cache(maxsize=2)
def _planned_pairs(text: bytes) -> tuple[PlannedPair, ...]:
    return tuple(map(planned_pair, json.loads(b"[" + text.removesuffix(b"}"))))
