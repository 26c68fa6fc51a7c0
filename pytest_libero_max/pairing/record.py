"""The pair record: the only thing that leaves the simulator. JSON with a schema version.

It holds one entry an arm, and in it the columns of probes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from msgspec import Meta, field

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import NO_LATENCY, PATTERN
from pytest_libero_max.benchmark.structs import (
    AnyText,
    Count,
    Counts,
    Difficulty,
    Distance,
    Document,
    FileName,
    Flag,
    Name,
    NamedTexts,
    PlainObject,
    Positive,
    Proof,
    Sha256,
    SourceName,
    Text,
    Texts,
    Variant,
    convert,
    decode,
    fits,
    rule,
    shown,
    to_builtins,
)
from pytest_libero_max.errors import ReportError, did_you_mean, is_refusal
from pytest_libero_max.events.registry import family_of
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC, Arm
from pytest_libero_max.pairing.probe_columns import Columns
from pytest_libero_max.pairing.record_rules import (
    COMPONENTS,
    CONTROL_HZ,
    Timing,
    require_consistent,
    require_consistent_arm,
)

if TYPE_CHECKING:
    from pytest_libero_max.pairing.rollout import RolloutResult
    from pytest_libero_max.pairing.trajectory import QueryResult
    from pytest_libero_max.policies.contract import MemoryKind, PolicySpec

RECORD_VERSION = 3
Version = Annotated[int, Meta(ge=RECORD_VERSION, le=RECORD_VERSION)]
"""Version of the fields below."""

_OWN_FIELDS = ("approach", "clipping", "contacts", "response")
"""The probes whose columns are fields of an arm's record."""

PROGRAM = "program"
"""Fingerprint of a pair whose case has a program: the program's name and digest."""

Span = Annotated[tuple[Positive, ...], rule("two integers of at least 1", min_length=2, max_length=2)]

FILES, RESET_FILES = "files", "reset_files"
"""Fields of a record's policy: the files that loading it read, and those that ``reset`` has read besides in
the process so far, by name (:mod:`~pytest_libero_max.policies.files_read`)."""

LatencyText = Annotated[str, rule("steps, for example 4steps or 4steps,sync", pattern=PATTERN)]

ArmName = Annotated[str, Meta(pattern="^[a-z][a-z0-9_]*$")]
"""Name of an arm."""

ProbeName = Annotated[str, Meta(pattern="^[a-z][a-z0-9_]*$")]
"""Name of a probe."""

OUTCOMES = ("preserved_success", "change_associated_success", "regression", "persistent_failure")


class FiringRecord(Document, frozen=True, kw_only=True):
    """An entry of an arm's schedule that happened."""

    step: Count
    """Policy steps executed before it."""
    queries: Count
    """Policy queries before it."""
    distance_m: Distance
    """Distance of the end effector to the case's trigger entity then."""
    prefix_proof: Proof
    """Hash chain over (action, world digest) up to it, hexadecimal. Arms in which it is the same executed the
    same prefix."""
    evidence: PlainObject
    """Values before and after the change, and mean absolute pixel change per camera (0 to 255)."""


class ArmRecord(Document, frozen=True, kw_only=True, omit_defaults=True):
    """One arm of a measured case."""

    NOUN: ClassVar[str] = "arm"

    schedule: tuple[PlainObject, ...]
    """Entries of the arm, as :meth:`~pytest_libero_max.events.schedules.Entry.to_dict` writes it; empty for
    Base."""
    repetition: Count
    """Arms of another repetition were played independently, from the start."""
    success: Flag
    """True if the task was completed within the budget."""
    steps: Count
    """Policy steps taken, shared ones included."""
    queries: Count
    """Policy queries, shared ones included."""
    firings: tuple[FiringRecord, ...]
    """The entries of the schedule that happened, in order."""
    response_step: Count | None
    """Policy steps executed at the first query after the first firing, or None where there was none."""
    stale_actions: Count | None
    """Queued actions executed after the first firing and before that query, or with latency before its answer
    is there, held ones included; None where nothing happened. Where no query followed, all actions
    executed afterwards were stale."""
    min_distance_m: Distance
    """Smallest distance of the end effector to the case's trigger entity."""
    clipped_components: Count
    """Number of the 7 * steps components of executed actions that are beyond +-1; the controller clips them.
    Under absolute control only those of the gripper are counted."""
    contacts: Texts
    """Names of everything that touches the trigger entity at the end."""
    proof: Proof
    """The hash chain over the whole rollout, changes included, hexadecimal."""
    shares: Text | None
    """The earlier arm that this one equals bit for bit, because nothing happened in it that did not in the
    other: it was not played a second time. None for an arm that was played."""
    notes: Counts | None = None
    """Counts of a wrapper around the policy, summed over the queries of Base, or over those after the first
    firing of another arm; by name. Absent without such a wrapper."""
    returned: Span | None = None
    """Smallest and largest number of actions that a server returned to a query, before they were cut to H
    (chunk size); absent for other policies."""
    probes: Annotated[
        dict[ProbeName, Columns],
        rule("columns by probe, both named in lower case: values or lists of values, up to 2^63 - 1"),
    ] = field(default_factory=dict)
    """Columns of ``stages`` and of each probe that was asked for, by its name."""
    latency: LatencyText | None = None
    """Time that a query took, for example ``4steps``; absent where the world waited for the policy."""
    held_steps: Count | None = None
    """Steps in which the robot had no action to execute and waited for an answer; absent without latency, of
    the arm or of a change in its schedule."""
    policy: PlainObject | None = None
    """The spec of the policy that went on from the first entry, with its ``reference`` and ``code``; absent
    where that of the pair did."""

    components: Positive = COMPONENTS
    """Number of components of an action; absent where they are LIBERO's seven."""
    control_hz: Positive = CONTROL_HZ
    """Control steps in a second; absent where they are LIBERO's twenty."""

    @property
    def clipped_share(self) -> float:
        """Share of the components of the executed actions that were clipped."""
        return self.clipped_components / (self.components * self.steps) if self.steps else 0.0

    @classmethod
    def of(cls, arm: Arm, rollouts: Mapping[str, RolloutResult]) -> ArmRecord:
        """Return the record of an arm.

        Args:
            rollouts: End of every arm, in the order of the arms; those that ended as one have one object.
        """
        rollout = rollouts[arm.name]
        first = next(name for name, other in rollouts.items() if other is rollout)
        seen: Mapping[str, Mapping[str, Any]] = rollout.probes
        return cls(
            schedule=tuple(entry.to_dict() for entry in arm.schedule),
            repetition=arm.repetition,
            success=rollout.success,
            steps=rollout.steps,
            queries=len(rollout.queries),
            firings=tuple(
                FiringRecord(
                    step=firing.step,
                    queries=firing.queries,
                    distance_m=firing.distance_m,
                    prefix_proof=firing.proof,
                    evidence=firing.applied.to_dict(),
                )
                for firing in rollout.firings
            ),
            response_step=seen["response"]["response_step"],
            stale_actions=seen["response"]["stale_actions"],
            min_distance_m=seen["approach"]["min_distance_m"],
            clipped_components=seen["clipping"]["clipped_components"],
            contacts=tuple(seen["contacts"]["contacts"]),
            proof=rollout.proof,
            shares=None if first == arm.name else first,
            notes=_summed(rollout.queries[rollout.firings[0].queries if rollout.firings else 0 :]),
            returned=_span(rollout.queries),
            probes={name: dict(columns) for name, columns in seen.items() if name not in _OWN_FIELDS},
            components=rollout.robot.components,
            control_hz=rollout.robot.control_hz,
            **_waiting(arm, rollout),
        )

    def to_dict(self) -> Json:
        """Return JSON types only; without ``notes`` and ``probes`` where there are none."""
        return to_builtins(self)

    @classmethod
    def from_dict(cls, values: Json) -> ArmRecord:
        """Read what :meth:`to_dict` wrote, or raise ReportError."""
        arm = convert(values, cls)
        require_consistent_arm(arm)
        return arm


def _waiting(arm: Arm, rollout: RolloutResult) -> dict[str, Any]:
    if not arm.is_late:
        return {}
    return {
        "latency": None if arm.latency == NO_LATENCY else str(arm.latency),
        "held_steps": sum(step.held for step in rollout.trajectory.executed),
    }


def _span(queries: Sequence[QueryResult]) -> tuple[int, int] | None:
    """Return the smallest and largest number of actions that came back; None where it is not known."""
    returned = [query.returned for query in queries if query.returned is not None]
    return (min(returned), max(returned)) if returned else None


def query_times(rollouts: Mapping[str, RolloutResult]) -> dict[str, dict[str, int]]:
    """Return numbers of queries by their milliseconds, two digits, for Base and Dynamic after the event."""
    parts: dict[str, Sequence[QueryResult]] = {}
    if BASE in rollouts:
        parts[BASE] = rollouts[BASE].queries
    if DYNAMIC in rollouts and rollouts[DYNAMIC].firings:
        parts[DYNAMIC] = rollouts[DYNAMIC].queries[rollouts[DYNAMIC].firings[0].queries :]
    times = {}
    for name, queries in parts.items():
        spent = [float(f"{1000 * query.seconds:.2g}") for query in queries if query.seconds is not None]
        times[name] = {f"{value:g}": count for value, count in sorted(Counter(spent).items())}
    return {name: counts for name, counts in times.items() if counts}


def _summed(queries: Sequence[QueryResult]) -> dict[str, int] | None:
    """Return the notes of some queries, added up; None where nothing was noted."""
    noted = [query.notes for query in queries if query.notes is not None]
    names = sorted({name for notes in noted for name in notes})
    return {name: sum(notes.get(name, 0) for notes in noted) for name in names} if noted else None


class PairRecord(Document, frozen=True, kw_only=True, tag_field="line", tag="pair"):
    """One measured case, arm by arm.

    Everything but ``timings`` is a function of the case, the policy and the versions in ``fingerprints``:
    two runs, ``fork`` and ``replay``, any number of workers give the same bytes (:meth:`identity`).

    The properties view the record as a pair, Base and Dynamic.
    """

    NOUN: ClassVar[str] = "pair record"

    schema_version: Version = RECORD_VERSION
    case_id: Name
    """Unique in the manifest."""
    item_id: FileName
    """Name of the test item."""
    case_digest: Sha256
    """SHA-256 of the case."""
    source: SourceName
    """Source of the case: ``plus``, ``pro``, or the benchmark of an unmodified task, such as ``libero``."""
    source_category: Name
    """Category of the source variation; ``Unmodified`` for an unmodified task."""
    difficulty: Difficulty | None
    """LIBERO-Plus difficulty 1 to 5, or None."""
    suite: Name
    """LIBERO suite."""
    task_index: Count
    """Index of the task in its source's registry."""
    init_state_index: Count
    """Index of the initial state."""
    policy_seed: Count
    """Seed of the policy, the same in every arm."""
    instruction: Text
    """Instruction of the policy when the episode began."""
    event: Name
    """Name of the case's event."""
    family: Name
    """The event's family."""
    variant: Variant
    """The event's parameter variant, 0 or 1."""
    severity: Name
    """The event's severity."""
    trigger_entity: Name
    """The entity that the distances and contacts of every arm are about."""
    max_steps: Count
    """Policy steps an episode may take."""
    arms: Annotated[dict[ArmName, ArmRecord], Meta(min_length=1)]
    """Results by name of the arm. A pair has ``base`` and ``dynamic``; ``base_again`` is Base played a second
    time for the noise floor."""
    policy: PlainObject
    """The policy's spec as played. Where it has a memory, ``memory`` says how that was brought to the event:
    ``snapshot``, or what it was shown again (``queries``, ``frames``). ``files`` and ``reset_files`` are
    those that it has read, of a policy without a revision that is no server's and not this package's."""
    fingerprints: NamedTexts
    """Everything else that could change a result: versions, substrate, the policy's code, the digests of the
    scene and of the state in which the pair starts, the case's program if it has one."""
    timings: Annotated[
        dict[str, Timing],
        rule("numbers of at least 0, an address, and numbers of queries by milliseconds, by arm"),
    ] = field(default_factory=dict)
    """Wall-clock seconds, server_batch (a count) and server (an address); the only fields that differ between
    runs. ``pair_s`` is the whole pair, ``world_s`` the building of its scene. ``reset_s``, ``prefix_s``,
    an ``arm_..._s`` for each arm and ``asked_again_s`` (the check of a policy's answer) are its parts;
    ``observe_s`` (images), ``policy_s`` and ``event_s`` are again parts of these. ``query_ms`` has the
    numbers of queries by their milliseconds, for Base and for Dynamic after the event."""

    def __post_init__(self) -> None:
        name = self.policy.get("name", "?")
        if not fits(name, Name):
            raise ValueError(f"policy.name={shown(name)} but must be printable text on one line")

    @classmethod
    def of(
        cls,
        case: Case,
        instruction: str,
        arms: Mapping[str, ArmRecord],
        spec: PolicySpec,
        fingerprints: Mapping[str, str],
        timings: Mapping[str, object],
        memory: MemoryKind = "none",
    ) -> PairRecord:
        """Return the record of a case whose arms have been played."""
        program = {} if case.program is None else {PROGRAM: f"{case.program.name} {case.program.digest}"}
        return cls(
            case_id=case.case_id,
            item_id=case.item_id,
            case_digest=case.digest,
            source=case.source,
            source_category=case.source_category,
            difficulty=case.difficulty,
            suite=case.suite,
            task_index=case.task_index,
            init_state_index=case.init_state_index,
            policy_seed=case.policy_seed,
            instruction=instruction,
            event=case.event.name,
            family=family_of(case.event.name),
            variant=case.event.variant,
            severity=case.event.severity,
            trigger_entity=case.event.entity,
            max_steps=case.budget,
            arms=dict(arms),
            policy=spec.to_dict() | ({} if memory == "none" else {"memory": memory}),
            fingerprints={**fingerprints, **program},
            timings=dict(timings),
        )

    def arm(self, name: str) -> ArmRecord:
        """Return the arm of that name.

        Raises:
            ReportError: The case was not played in it.
        """
        if name not in self.arms:
            raise ReportError(
                f"{self.item_id} was not played in an arm {name!r}. {did_you_mean(name, self.arms)}"
            )
        return self.arms[name]

    # The pair.

    @property
    def control_hz(self) -> int:
        """Control steps in a second."""
        return next(iter(self.arms.values())).control_hz

    @property
    def configuration(self) -> str:
        """Task and initial state within its source category: its cases differ in their event alone."""
        parts = (self.source, self.source_category, self.suite, self.task_index, self.init_state_index)
        return "|".join(map(str, parts))

    @property
    def base_success(self) -> bool:
        """True if Base completed the task."""
        return self.arm(BASE).success

    @property
    def dynamic_success(self) -> bool:
        """True if Dynamic completed the task. Equal to Base where the event never fired."""
        return self.arm(DYNAMIC).success

    @property
    def base_steps(self) -> int:
        """Policy steps Base took."""
        return self.arm(BASE).steps

    @property
    def dynamic_steps(self) -> int:
        """Policy steps Dynamic took, executed prefix included."""
        return self.arm(DYNAMIC).steps

    @property
    def trigger(self) -> FiringRecord | None:
        """The event, or None where it never fired."""
        firings = self.arm(DYNAMIC).firings
        return firings[0] if firings else None

    @property
    def triggered(self) -> bool:
        """True if the event fired."""
        return self.trigger is not None

    @property
    def trigger_step(self) -> int | None:
        """Policy steps executed when the event fired, or None where it never did."""
        return self.trigger.step if self.trigger else None

    @property
    def trigger_distance_m(self) -> float | None:
        """Distance of the end effector to the trigger entity then."""
        return self.trigger.distance_m if self.trigger else None

    @property
    def min_distance_m(self) -> float:
        """Smallest such distance over the Base rollout."""
        return self.arm(BASE).min_distance_m

    @property
    def response_step(self) -> int | None:
        """Policy steps executed at the first query after the event, or None where there was none."""
        return self.arm(DYNAMIC).response_step

    @property
    def responded(self) -> bool:
        """True if a query followed the event."""
        return self.response_step is not None

    @property
    def stale_actions(self) -> int | None:
        """Queued actions executed after the event and before that query; None where it never fired."""
        return self.arm(DYNAMIC).stale_actions

    @property
    def base_queries(self) -> int:
        """Policy queries of Base."""
        return self.arm(BASE).queries

    @property
    def dynamic_queries(self) -> int:
        """Policy queries of Dynamic after the event."""
        return self.arm(DYNAMIC).queries - self.trigger.queries if self.trigger else 0

    @property
    def prefix_digest(self) -> str | None:
        """Hash chain of the executed prefix; Base and Dynamic both arrived at it."""
        return self.trigger.prefix_proof if self.trigger else None

    @property
    def base_digest(self) -> str:
        """The hash chain over the whole Base rollout."""
        return self.arm(BASE).proof

    @property
    def dynamic_digest(self) -> str | None:
        """The hash chain over the whole Dynamic rollout, event included; None where it never fired."""
        return self.arm(DYNAMIC).proof if self.trigger else None

    @property
    def evidence(self) -> Json | None:
        """Values before and after the event."""
        return self.trigger.evidence if self.trigger else None

    @property
    def contacts(self) -> dict[str, list[str]]:
        """Names of everything that touches the trigger entity at the end, by arm."""
        return {name: list(self.arm(name).contacts) for name in (BASE, DYNAMIC)}

    @property
    def base_repeat(self) -> Json | None:
        """Second play of Base, if any: ``success``, and ``identical``, True if bit for bit equal."""
        again = self.arms.get(BASE_AGAIN)
        if again is None:
            return None
        return {"success": again.success, "identical": again.proof == self.arm(BASE).proof}

    @property
    def outcome(self) -> str:
        """One of :data:`OUTCOMES`."""
        return OUTCOMES[
            (0 if self.dynamic_success else 2) if self.base_success else (1 if self.dynamic_success else 3)
        ]

    def to_dict(self) -> Json:
        """Return JSON types only, ``schema_version`` first."""
        values = to_builtins(self)
        del values["line"]
        return values

    def identity(self) -> Json:
        """Return what was played: everything but the timings, and what a server returned beyond it.

        Which files ``reset`` has read by then depends on the pairs that the process played before.
        """
        values = self.to_dict()
        del values["timings"]
        values["policy"].pop(RESET_FILES, None)
        for arm in values["arms"].values():
            arm.pop("returned", None)
        return values

    @classmethod
    def from_dict(cls, values: Json) -> PairRecord:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: A field is missing or unknown, holds what it cannot hold, or contradicts another one;
                or the schema version is not :data:`RECORD_VERSION`.
        """
        require_version(values, "pair record")
        return require_consistent(convert(values, cls))

    @classmethod
    def from_json(cls, line: bytes) -> PairRecord:
        """Read a line of ``pairs.jsonl``; the errors are those of :meth:`from_dict`."""
        return require_consistent(decode(line, cls))


def require_version(values: Json, what: str) -> None:
    """Check that a stored object is of a schema version that can be read, or raise ReportError."""
    version = values.get("schema_version")
    if type(version) is not int or version != RECORD_VERSION:
        raise ReportError(
            f"schema_version={version!r} of a {what}, but this version reads "
            f"{RECORD_VERSION}. Read it with the version of pytest-libero-max that wrote it."
        )


POLICY_PHASE = "policy"
"""Phase of an error that every other pair would end with as well: the policy cannot be played at all."""

CRASH_PHASE = "crash"
"""Phase of an error: the process that played the pair died."""

RECORD_PHASE = "record"
"""Phase of an error: the pair was played, and its record cannot be stored."""


class PairError(Document, frozen=True, kw_only=True, tag_field="line", tag="error"):
    """A pair that could not be measured: an error of the machinery, never a failure of the policy."""

    NOUN: ClassVar[str] = "pair error"

    @property
    def refused(self) -> bool:
        """True for what the policy did: then the pair is not played again."""
        return is_refusal(self.kind)

    schema_version: Version = RECORD_VERSION
    case_id: Name
    """Unique in the manifest."""
    item_id: FileName
    """Name of the test item."""
    case_digest: Sha256
    """SHA-256 of the case."""
    kind: Text
    """Name of the exception class."""
    message: AnyText
    """Message of the exception."""
    phase: Text
    """``setup``, the name of the arm that was being played, ``crash``, ``record`` where what was played makes
    no valid record, or ``policy`` where no pair at all can be played with the policy."""

    def to_dict(self) -> Json:
        """Return JSON types only, ``schema_version`` first."""
        values = to_builtins(self)
        del values["line"]
        return values

    @classmethod
    def of(cls, case: Case, error: BaseException, phase: str, more: str = "") -> PairError:
        """Return the error of a case; what UTF-8 cannot hold of its message, with more text, is replaced."""
        message = f"{error}{more}".encode("utf-8", "replace").decode()
        return cls(
            case_id=case.case_id,
            item_id=case.item_id,
            case_digest=case.digest,
            kind=type(error).__name__,
            message=message,
            phase=phase,
        )

    @classmethod
    def from_dict(cls, values: Json) -> PairError:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: It has other fields or another schema version, or a value that cannot be.
        """
        require_version(values, "pair error")
        return convert(values, cls)


def is_error(values: Json) -> bool:
    """Return True if a stored result is a :class:`PairError`; otherwise it is a :class:`PairRecord`."""
    return "kind" in values


def result_from_dict(values: Json) -> PairRecord | PairError:
    """Read what either ``to_dict`` wrote."""
    return PairError.from_dict(values) if is_error(values) else PairRecord.from_dict(values)
