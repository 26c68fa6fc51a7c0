"""Outcomes of a run: the part of its records that comparisons need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import RESET_FILES, PairRecord
from pytest_libero_max.pairing.scene_fingerprints import SCENE, START
from pytest_libero_max.runs.comparability import Side
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped, ended_by_rule
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.stats.paired import Pairs
from pytest_libero_max.worlds.rendering.context import renderers


class Played(NamedTuple):
    """What caveats need of a record; each field as in :class:`.PairRecord`."""

    source: str
    source_category: str
    event: str
    instruction: str
    policy_seed: int
    max_steps: int
    policy: Json
    fingerprints: Mapping[str, str]
    timings: frozenset[str]
    triggered: bool
    proofs: Mapping[str, str]

    @classmethod
    def of(cls, record: PairRecord) -> Played:
        """Return what caveats need of a record."""
        return cls(
            record.source,
            record.source_category,
            record.event,
            record.instruction,
            record.policy_seed,
            record.max_steps,
            record.policy,
            record.fingerprints,
            timings=frozenset(record.timings),
            triggered=bool(record.arms[DYNAMIC].firings),
            proofs={name: arm.proof for name, arm in record.arms.items()},
        )


@dataclass(frozen=True, eq=False)
class RunOutcomes:
    """A run reduced to the data of a comparison."""

    run: Run
    case_ids: tuple[str, ...]
    pairs: Pairs
    policy: Json | None
    """The spec of the first record; None without a record."""
    scenes: tuple[str, ...]
    """Fingerprints of scene and start of each case, in the same order; empty where a record of an earlier
    version has none."""
    renderers: tuple[str, ...]
    """What drew the images, see :func:`.renderers`; empty where no record says so."""
    played: tuple[Played, ...]
    stopped: Stopped | None = None

    @classmethod
    def of(cls, stored: StoredRun) -> RunOutcomes:
        """Return the outcomes of a run that has been read."""
        records = stored.records
        tasks = {pair.case_id: pair.task for pair in stored.run.planned}
        return cls(
            run=stored.run,
            case_ids=tuple(record.case_id for record in records),
            pairs=columns_of(records, [tasks.get(record.case_id, "?") for record in records]),
            policy=records[0].policy if records else None,
            scenes=tuple(_scene_of(record.fingerprints) for record in records),
            renderers=tuple(sorted(renderers(record.fingerprints for record in records))),
            played=tuple(Played.of(record) for record in records),
            stopped=stored.stopped,
        )

    @property
    def stopped_by_rule(self) -> bool:
        """True if a rule kept the run from its planned number of pairs, see :func:`.ended_by_rule`."""
        return ended_by_rule(self.stopped, self.run.planned, self.policy, {*self.case_ids})

    @property
    def side(self) -> Side:
        """The run as far as its comparability is concerned."""
        scenes = dict(zip(self.case_ids, self.scenes, strict=True))
        budgets = {case: pair.max_steps for case, pair in zip(self.case_ids, self.played, strict=True)}
        fingerprints = self.played[0].fingerprints if self.played else {}
        return Side(self.run, self._policy_with_files(), scenes, self.renderers, budgets, fingerprints)

    def _policy_with_files(self) -> Json | None:
        """Return the spec of the first record, with the files that ``reset`` has read in any."""
        read = [pair.policy[RESET_FILES] for pair in self.played if RESET_FILES in pair.policy]
        files: Json = {name: identity for found in reversed(read) for name, identity in found.items()}
        return self.policy | {RESET_FILES: files} if self.policy is not None and files else self.policy


def _scene_of(fingerprints: Mapping[str, str]) -> str:
    return " ".join(fingerprints.get(name, "") for name in (SCENE, START)).strip()


def columns_of(
    records: Sequence[PairRecord], tasks: Sequence[str], base: str = BASE, dynamic: str = DYNAMIC
) -> Pairs:
    """Return the columns of the statistics, one row a record, or raise ReportError."""
    arms = [record.arm(dynamic) for record in records]
    return Pairs.of(
        base=[record.arm(base).success for record in records],
        dynamic=[arm.success for arm in arms],
        triggered=[bool(arm.firings) for arm in arms],
        responded=[arm.response_step is not None for arm in arms],
        stale=[-1 if arm.stale_actions is None else arm.stale_actions for arm in arms],
        source=[record.source for record in records],
        task=tasks,
    )


def read_outcomes(path: Path) -> RunOutcomes:
    """Read the outcomes of a run."""
    return RunOutcomes.of(read_pairs(path))
