"""Examine many cases in worker processes, and keep each result in a file as soon as it is known."""

from __future__ import annotations

import json
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.code import code_digest
from pytest_libero_max.benchmark.documents import Json, canonical_digest, cut_torn_line
from pytest_libero_max.construction.examination import Examination, examine
from pytest_libero_max.construction.preflight import Problem
from pytest_libero_max.errors import ChangeError, SubstrateError
from pytest_libero_max.policies.code import adapter_digest
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.sources import catalogue, digest_of, open_substrate, variation_of
from pytest_libero_max.worlds.contract import Substrate
from pytest_libero_max.worlds.threads import use_one_blas_thread

if TYPE_CHECKING:
    from pytest_libero_max.worlds.kind import SubstrateOptions

BATCH = 12
"""Cases that a process takes at a time: neighbours share scenes."""

NAME = "examinations.jsonl"

_EXAMINING_ROOMS = ("changes", "events", "pairing", "policies", "worlds")


@dataclass(frozen=True)
class Progress:
    """How far an examination is.

    Attributes:
        done: Cases examined, in this session or before.
        total: Cases to examine in all.
        failed: How many did not pass in this session.
        seconds_left: At the pace of this session.
    """

    done: int
    total: int
    failed: int
    seconds_left: float

    def __str__(self) -> str:
        left = f"{self.seconds_left / 60:.0f} min left"
        return f"{self.done} of {self.total} cases examined, {self.failed} failed, {left}"


class Examiner:
    """Examines cases, and remembers what it found.

    What was found is kept in a folder named by everything that it depends on: scenes, versions, code and the
    expert's files. An interrupted examination goes on where it stopped; after any other change it begins
    again in another folder.

    Close it, or use it in a ``with`` statement: it keeps its processes for the next examination.

    Args:
        folder: Where to keep examinations.
        expert: Adapter of the scripted expert, as on the command line of a run; None: the hand goes straight
            to the target, and no case gets a certificate.
        jobs: Processes.
        report: Told about the progress.
        substrate: What builds the worlds.
        options: What the substrate is told.
    """

    def __init__(
        self,
        folder: Path,
        expert: str | None,
        jobs: int,
        report: Callable[[Progress], None] | None = None,
        substrate: str = "embedded",
        options: SubstrateOptions | None = None,
    ) -> None:
        self.path = folder / inputs_digest(expert, substrate, options)[:16] / NAME
        self._report = report or _ignore
        self._order = scene_order(substrate, options)
        self._known = read_examinations(self.path)
        use_one_blas_thread()
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(jobs, context, _begin, (expert, substrate, options))

    def __enter__(self) -> Examiner:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; cases that wait are not begun."""
        self._pool.shutdown(cancel_futures=True)

    def examine(self, cases: Sequence[Case]) -> Mapping[str, Examination]:
        """Examinations by case id, in the order of the cases.

        Raises:
            AdapterError: The expert broke its contract, or cannot be loaded.
            SimulatorError: The simulation breaks after an event that passed.
        """
        todo = sorted((case for case in cases if not self._knows(case)), key=self._order)
        if todo:
            self._measure(todo, len(cases))
        return {case.case_id: self._known[case.case_id] for case in cases}

    def _knows(self, case: Case) -> bool:
        known = self._known.get(case.case_id)
        return known is not None and known.case_digest == case.digest

    def _measure(self, todo: list[Case], total: int) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        done, failed, began = total - len(todo), 0, time.monotonic()
        with self.path.open("a", encoding="utf-8") as file:
            for examination in self._examinations(todo):
                file.write(json.dumps(examination.to_dict()) + "\n")
                file.flush()
                self._known[examination.case_id] = examination
                done, failed = done + 1, failed + (not examination.passed)
                pace = (time.monotonic() - began) / (done - total + len(todo))
                self._report(Progress(done, total, failed, pace * (total - done)))

    def _examinations(self, cases: Sequence[Case]) -> Iterator[Examination]:
        """In the order in which they come."""
        records = [case.record for case in cases]
        batches = (records[first : first + BATCH] for first in range(0, len(records), BATCH))
        for future in as_completed([self._pool.submit(_examine, batch) for batch in batches]):
            yield from future.result()


def read_examinations(path: Path) -> dict[str, Examination]:
    """The examinations of a file by case id; a last line that was cut off is removed from it."""
    if not path.exists():
        return {}
    cut_torn_line(path)
    examinations = (Examination.from_dict(json.loads(line)) for line in path.read_bytes().splitlines())
    return {examination.case_id: examination for examination in examinations}


def inputs_digest(expert: str | None, substrate: str, options: SubstrateOptions | None) -> str:
    """SHA-256 of everything but the case that an examination depends on, hexadecimal.

    Versions, scenes, variations, the expert's code and the code that plays: after a change of any of them,
    old examinations no longer hold. Comments, docstrings and layout do not count.

    Raises:
        AdapterError: The expert is not found.
    """
    return canonical_digest(
        {
            "versions": dict(open_substrate(substrate, options).fingerprint()),
            "catalogues": [digest_of(catalogue(source)) for source in ("plus", "pro")],
            "expert": None if expert is None else adapter_digest(expert),
            "code": code_digest(examining_code(Path(__file__).parents[1])),
        }
    )


def examining_code(package: Path) -> list[Path]:
    """The files of this package that decide what an examination finds.

    Args:
        package: The folder of :mod:`pytest_libero_max`.
    """
    rooms = [path for room in _EXAMINING_ROOMS for path in (package / room).rglob("*.py")]
    return [*rooms, *(package / "construction" / name for name in ("preflight.py", "examination.py"))]


def scene_order(substrate: str, options: SubstrateOptions | None) -> Callable[[Case], tuple[Any, ...]]:
    """What cases are sorted by, so that neighbours share a scene.

    The installed LIBERO-Plus and LIBERO-PRO have catalogues of their own, which are not consulted.
    """
    own = options is not None and options.variations == "own"
    return _installed_scene if substrate == "libero" and not own else _scene


def _scene(case: Case) -> tuple[Any, ...]:
    if case.source == "libero":
        return case.suite, case.task_index, "", case.case_id
    variation = variation_of(case)
    return case.suite, variation.base_index, json.dumps(variation.scene, sort_keys=True), case.case_id


def _installed_scene(case: Case) -> tuple[Any, ...]:
    return case.suite, case.source, case.task_index, case.source_category or "", case.case_id


_substrate: Substrate
_expert: Policy | None


def _begin(expert: str | None, substrate: str, options: SubstrateOptions | None) -> None:
    """Set up a process: the worlds, and a policy that never asks for images."""
    global _substrate, _expert
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _substrate = open_substrate(substrate, options)
    _expert = None
    if expert is not None:
        _expert = load_policy(expert)
        _expert.spec = replace(_expert.spec, cameras=())


def _end_with_parent() -> None:
    """End this process with its parent; otherwise it would wait forever once the parent was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _examine(records: Sequence[Json]) -> list[Examination]:
    return [_examination(case) for case in map(parse_case, records)]


def _examination(case: Case) -> Examination:
    try:
        return examine(_substrate.world(case), case, _expert)
    except (SubstrateError, ChangeError) as error:  # the substrate lacks something that the case needs
        return Examination(case.case_id, case.digest, (Problem("substrate", str(error)),), None)


def _ignore(progress: Progress) -> None:
    """Report no progress."""
