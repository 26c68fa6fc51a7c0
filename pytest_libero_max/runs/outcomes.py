"""Outcomes of a run: the part of its records that comparisons need, read without decoding the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec import Raw, Struct

from pytest_libero_max.benchmark.documents import Json, read_content
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import RECORD_VERSION, RESET_FILES, PairRecord
from pytest_libero_max.pairing.scene_fingerprints import SCENE, START
from pytest_libero_max.runs.agreement import Agreement, SamePlay
from pytest_libero_max.runs.comparability import Side
from pytest_libero_max.runs.lock import require_ended
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped, ended_by_rule
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun, decode_line, pairs_file, read_pairs
from pytest_libero_max.stats.paired import Pairs
from pytest_libero_max.worlds.rendering.context import renderers


class Played(NamedTuple):
    """What caveats need of a record; each field as in :class:`.PairRecord`."""

    source: str
    source_category: str
    event: str
    instruction: str
    """As the policy was given it."""
    policy_seed: int
    """Seed of the case."""
    max_steps: int
    """Budget of the episode."""
    policy: Json
    fingerprints: Mapping[str, str]
    """What the pair was played with."""
    timings: frozenset[str]
    """Names of its timings."""
    triggered: bool
    proofs: Mapping[str, str]

    @classmethod
    def of(cls, record: PairRecord) -> Played:
        """Return what caveats need of a record."""
        return cls.of_fields(record, record.policy)

    @classmethod
    def of_fields(cls, record: PairRecord | _Line, policy: Json) -> Played:
        """Return what caveats need of a record, or of a line of which not everything was decoded."""
        return cls(
            **{name: getattr(record, name) for name in _SAME_IN_BOTH},
            policy=policy,
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
    """Their outcomes in the same order."""
    policy: Json | None
    """The spec of the first record; None without a record."""
    scenes: tuple[str, ...]
    """Fingerprints of scene and start of each case, in the same order; empty where a record of an earlier
    version has none."""
    renderers: tuple[str, ...]
    """What drew the images, see :func:`.renderers`; empty where no record says so."""
    played: tuple[Played, ...]
    """What caveats need of each record, in the same order."""
    stopped: Stopped | None = None
    """Stop of the run; None where it was not stopped."""

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
    """Return the columns of the statistics, one row a record.

    Args:
        records: Measured pairs.
        tasks: The task of each, see :class:`~pytest_libero_max.runs.plan.PlannedPair`.
        base: Name of the arm in which nothing happens.
        dynamic: Name of the arm in which the event does.

    Raises:
        ReportError: A record lacks one of the arms.
    """
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


class _Arm(Struct):
    success: bool
    firings: list[Raw]
    response_step: int | None
    stale_actions: int | None
    proof: str


class _Line(Struct):
    """The fields of a line of ``pairs.jsonl`` that a comparison needs."""

    line: str
    schema_version: int
    case_id: str
    item_id: str = ""
    case_digest: str = ""
    arms: dict[str, _Arm] = msgspec.field(default_factory=dict)
    policy: Raw = msgspec.field(default_factory=Raw)
    fingerprints: dict[str, str] = msgspec.field(default_factory=dict)
    source: str = ""
    source_category: str = ""
    event: str = ""
    instruction: str = ""
    policy_seed: int = 0
    max_steps: int = 0
    timings: dict[str, Raw] = msgspec.field(default_factory=dict)


_SAME_IN_BOTH = (
    "source",
    "source_category",
    "event",
    "instruction",
    "policy_seed",
    "max_steps",
    "fingerprints",
)
"""Fields that a record and a line have as :class:`Played` has them."""


class _PolicyOfLine(NamedTuple):
    """The fields of a record about the policy and its instruments."""

    item_id: str
    suite: str
    max_steps: int
    policy: Json
    fingerprints: dict[str, str]


_DECODER = msgspec.json.Decoder(_Line)


def read_outcomes(path: Path) -> RunOutcomes:
    """Read the outcomes of a run.

    Where every line says what a comparison expects of it, nothing else of the lines is read. Everything else
    (an older version, damage, pairs of another run) is left to :func:`.store.read_pairs`, which checks all of
    a line and names what is wrong.
    """
    pairs_path = pairs_file(path)
    if pairs_path.name == PAIRS_NAME:
        require_ended(pairs_path.parent)
    try:
        found = _fast(pairs_path)
    except (OSError, ValueError, RecursionError, ReportError):
        found = None
    return RunOutcomes.of(read_pairs(pairs_path)) if found is None else found


def _fast(path: Path) -> RunOutcomes | None:
    """Read the outcomes from lines of one version and one policy that were planned; None of other lines.

    Raises:
        ValueError: A line is damaged.
        OSError: The file cannot be read.
    """
    head, _, rest = read_content(path).partition(b"\n")
    run = decode_line(head)
    if not isinstance(run, Run):
        return None
    planned = {pair.case_id: pair for pair in run.planned}
    first: _Line | None = None
    policy: Json = {}
    same_play = SamePlay()
    measured: dict[str, _Line] = {}
    for text in rest.split(b"\n")[:-1]:
        line = _DECODER.decode(text)
        pair = planned.get(line.case_id)
        if pair is None or pair.case_digest != line.case_digest or line.schema_version != RECORD_VERSION:
            return None
        if line.line == "error":
            continue
        if line.line != "pair" or line.case_id in measured or not {BASE, DYNAMIC} <= {*line.arms}:
            return None
        if first is None:  # all that one record says, and that it agrees with the header of the run
            first, policy = line, msgspec.json.decode(line.policy)
            Agreement(run).add(PairRecord.from_json(text), "first")
        if line.policy != first.policy:
            return None
        same_play.add(_PolicyOfLine(line.item_id, pair.suite, line.max_steps, policy, line.fingerprints))
        measured[line.case_id] = line
    lines = measured.values()
    dynamic = [line.arms[DYNAMIC] for line in lines]
    return RunOutcomes(
        run=run,
        case_ids=tuple(measured),
        pairs=Pairs.of(
            base=[line.arms[BASE].success for line in lines],
            dynamic=[arm.success for arm in dynamic],
            triggered=[bool(arm.firings) for arm in dynamic],
            responded=[arm.response_step is not None for arm in dynamic],
            stale=[-1 if arm.stale_actions is None else arm.stale_actions for arm in dynamic],
            source=[planned[case_id].source for case_id in measured],
            task=[planned[case_id].task for case_id in measured],
        ),
        policy=None if first is None else policy,
        scenes=tuple(_scene_of(line.fingerprints) for line in lines),
        renderers=tuple(sorted(renderers(line.fingerprints for line in lines))),
        played=tuple(Played.of_fields(line, policy) for line in lines),
    )
