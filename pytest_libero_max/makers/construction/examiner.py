"""Examine and certify many cases in worker processes, and keep each result as soon as it is known."""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import msgspec

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.certificates import Certificate, Ending
from pytest_libero_max.benchmark.documents import Json, canonical_digest, cut_torn_line
from pytest_libero_max.errors import ChangeError, ManifestError, SubstrateError, counted
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.machine import end_with_parent, return_large_blocks
from pytest_libero_max.makers.construction.preflight import Preflight, Problem, preflight
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.adapter_digest import adapter_digest
from pytest_libero_max.policies.contract import Policy
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.contract import Substrate, SubstrateOptions
from pytest_libero_max.substrates.registry import DEFAULT, SUBSTRATES, open_substrate, own_catalogue
from pytest_libero_max.substrates.variation import digest_of
from pytest_libero_max.worlds.contract import World
from pytest_libero_max.worlds.threads import use_one_blas_thread

EXAMINED, CERTIFIED = "examined", "certified"
EXAMINATIONS, CERTIFICATES = "examinations.jsonl", "certificates.jsonl"

RULES_VERSION = 1
"""Version of the rules by which cases are examined and certified.

Raise it when an examination or a certificate of some case may come out otherwise: when a check of the
preflight asks for something else; when an event, a change or the drive to the trigger does something else;
when an embedded scene is another one, which the test of the golden scenes says. All cases are then examined
again. A change of names, comments, messages or speed is no reason. The frozen tracks hold no version of the
rules: they stay valid until somebody builds them anew.
"""

Found = TypeVar("Found", Preflight, Certificate)


@dataclass(frozen=True)
class Progress:
    """Progress of the work."""

    verb: str
    """Kind of work: ``examined`` or ``certified``."""
    done: int
    total: int
    good: int
    """Number of those done that pass the preflight, or are solved."""
    per_minute: float | None
    """Cases done a minute since this run began; None before the first one."""

    @property
    def ended(self) -> bool:
        """True if all is done."""
        return self.done == self.total

    def __str__(self) -> str:
        good = "pass" if self.verb == EXAMINED else "solved"
        words = [f"{self.done} of {counted(self.total, 'case')} {self.verb}", f"{self.good} {good}"]
        if self.per_minute is not None:
            words.append(f"{self.per_minute:.0f}/min")
            if not self.ended:
                words.append(f"{(self.total - self.done) / self.per_minute:.0f} min left")
        return ", ".join(words)


def certify(world: World, case: Case, expert: Policy) -> Certificate:
    """Play a case with a policy that solves the tasks; images are rendered only if it asks for them."""
    stage = Stage(case, world, expert)
    _, dynamic, *_ = arms_of(case)
    result = Rollout.start(stage, (dynamic,)).advance_to_end()
    if not result.firings:
        return Certificate("not_triggered")
    ending: Ending = "solved"
    if not result.success:
        without_event = Rollout.start(stage).advance_to_end()
        ending = "unsolved" if without_event.success else "base_unsolved"
    return Certificate(ending, result.firings[0].step, result.steps)


class Examiner:
    """Examines and certifies cases, and keeps the results.

    Results are kept in folders named by everything that they depend on (:func:`inputs_digest`). Interrupted
    work is resumed; after a change of any of it, work begins again in another folder.
    Close it, or use it in a ``with`` statement: it keeps its processes for the next cases.
    """

    def __init__(
        self,
        folder: Path,
        jobs: int,
        report: Callable[[Progress], object] = lambda progress: None,
        substrate: str = DEFAULT,
        options: SubstrateOptions | None = None,
    ) -> None:
        self._folder, self._substrate, self._options = folder, substrate, options
        self._digests: dict[str | None, str] = {}
        self._report = report
        self._order = scene_order(substrate, options)
        use_one_blas_thread()
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(jobs, context, _begin, (substrate, options))

    def __enter__(self) -> Examiner:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; cases that wait are not begun."""
        self._pool.shutdown(cancel_futures=True)

    def path(self, expert: str | None = None) -> Path:
        if expert not in self._digests:  # takes seconds, and a build asks for it in every round
            self._digests[expert] = inputs_digest(expert, self._substrate, self._options)
        name = EXAMINATIONS if expert is None else CERTIFICATES
        return self._folder / self._digests[expert][:16] / name

    def examine(self, cases: Sequence[Case]) -> Mapping[str, Preflight]:
        """Preflights by case id, in the order of the cases. No policy has a part in them."""
        return self._find(EXAMINED, cases, Ledger(self.path(), Preflight), _examine)

    def certify(self, cases: Sequence[Case], expert: str) -> Mapping[str, Certificate]:
        """Certificates by case id, in the order of the cases, from the play of a scripted expert.

        Raises:
            AdapterError: The expert broke its contract, or cannot be loaded.
            SimulatorError: A simulation breaks.
        """
        ledger = Ledger(self.path(expert), Certificate)
        return self._find(CERTIFIED, cases, ledger, partial(_certify, expert))

    def _find(
        self,
        verb: str,
        cases: Sequence[Case],
        ledger: Ledger[Found],
        find: Callable[[Sequence[Json]], list[Found]],
    ) -> dict[str, Found]:
        todo = [case for case in sorted(cases, key=self._order) if ledger.of(case) is None]
        size = SUBSTRATES[self._substrate].batch
        batches = [todo[first : first + size] for first in range(0, len(todo), size)]
        waiting = {self._pool.submit(find, [case.record for case in batch]): batch for batch in batches}
        began, before, done = time.monotonic(), len(cases) - len(todo), 0
        good = sum(_is_good(known) for case in cases if (known := ledger.of(case)) is not None)
        if todo:
            self._report(Progress(verb, before, len(cases), good, None))
        for future in as_completed(waiting):
            for case, result in zip(waiting[future], future.result(), strict=True):
                ledger.add(case, result)
                done += 1
                good += _is_good(result)
                per_minute = 60.0 * done / max(time.monotonic() - began, 1e-9)
                self._report(Progress(verb, before + done, len(cases), good, per_minute))
        return {case.case_id: ledger.found[case.case_id] for case in cases}


class Ledger(Generic[Found]):
    """Results of cases, in a file that has a line for each as soon as it is known.

    A last line that was cut off is removed from it; a damaged one is a ManifestError.
    """

    def __init__(self, path: Path, kind: type[Found]) -> None:
        self._path = path
        self._digests: dict[str, str] = {}
        self.found: dict[str, Found] = {}
        if path.exists():
            cut_torn_line(path)
            for number, line in enumerate(path.read_bytes().splitlines(), start=1):
                try:
                    case_id, digest, values = msgspec.json.decode(line)
                    self._digests[case_id], self.found[case_id] = digest, msgspec.convert(values, kind)
                except (msgspec.MsgspecError, ValueError, TypeError, RecursionError) as error:
                    raise ManifestError(
                        f"{path}, line {number} is damaged ({type(error).__name__}: {error}). Remove the "
                        "line; its case is examined again."
                    ) from error

    def of(self, case: Case) -> Found | None:
        return self.found[case.case_id] if self._digests.get(case.case_id) == case.digest else None

    def add(self, case: Case, result: Found) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps([case.case_id, case.digest, msgspec.to_builtins(result)]) + "\n")
        self._digests[case.case_id], self.found[case.case_id] = case.digest, result


def inputs_digest(expert: str | None, substrate: str, options: SubstrateOptions | None) -> str:
    """SHA-256 of everything but the case that a preflight or an expert's certificate depends on, hexadecimal.

    These are the versions of packages and installations, the source variations, the identity of the expert,
    and :data:`RULES_VERSION`. After a change of any of them, old examinations no longer hold.
    """
    return canonical_digest(
        {
            "versions": dict(open_substrate(substrate, options).fingerprint()),
            "catalogues": [digest_of(own_catalogue().variations(source)) for source in ("plus", "pro")],
            "expert": None if expert is None else adapter_digest(expert),
            "rules": RULES_VERSION,
        }
    )


def scene_order(substrate: str, options: SubstrateOptions | None) -> Callable[[Case], tuple[Any, ...]]:
    """Return the key by which cases are sorted, so that neighbours share a scene."""
    scene_of, settings = SUBSTRATES[substrate].scene_of, options or SubstrateOptions()
    return lambda case: (*scene_of(settings, case), case.case_id)


_substrate: Substrate


def _begin(substrate: str, options: SubstrateOptions | None) -> None:
    global _substrate
    end_with_parent()  # otherwise it would wait forever after the parent was killed
    return_large_blocks()
    _substrate = open_substrate(substrate, options)


@cache
def _expert(name: str) -> Policy:
    """Return the expert of a process; it is never shown an image."""
    expert = load_policy(name)
    expert.spec = replace(expert.spec, cameras=())
    return expert


def _examine(records: Sequence[Json]) -> list[Preflight]:
    return [_preflight(case) for case in map(parse_case, records)]


def _preflight(case: Case) -> Preflight:
    try:
        return preflight(_substrate.world(case), case)
    except (SubstrateError, ChangeError) as error:  # the substrate lacks something that the case needs
        return Preflight((Problem("substrate", str(error)),))


def _certify(expert: str, records: Sequence[Json]) -> list[Certificate]:
    return [certify(_substrate.world(case), case, _expert(expert)) for case in map(parse_case, records)]


def _is_good(result: Preflight | Certificate) -> bool:
    return result.passed if isinstance(result, Preflight) else result.solved
