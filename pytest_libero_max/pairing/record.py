"""The pair record: the only thing that leaves the simulator. Flat JSON with a schema version."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError, did_you_mean

RECORD_VERSION = 1

OUTCOMES = ("preserved_success", "change_associated_success", "regression", "persistent_failure")


@dataclass(frozen=True)
class PairRecord:
    """One measured pair.

    Everything but ``timings`` is a function of the case, the policy and the versions in ``fingerprints``:
    two runs, ``fork`` and ``replay``, any number of workers give the same bytes (:meth:`identity`).

    Attributes:
        case_id: Unique in the manifest.
        item_id: Name of the test item.
        case_digest: SHA-256 of the case.
        base_success: Whether Base completed the task.
        dynamic_success: Whether Dynamic completed the task. Equal to Base where the event never fired.
        base_steps: Policy steps Base took.
        dynamic_steps: Policy steps Dynamic took, executed prefix included.
        trigger_step: Policy steps executed when the event fired, or None where the region was never reached.
        trigger_distance_m: Distance of the end effector to the trigger entity then.
        min_distance_m: Smallest such distance over the Base rollout.
        response_step: Policy steps executed at the first query after the event, or None where there was none.
        stale_actions: Queued actions executed after the event and before that query; None where the event
            never fired. Where no query followed, all actions executed after the event were stale.
        base_queries: Policy queries of Base.
        dynamic_queries: Policy queries of Dynamic after the event.
        prefix_digest: Hash chain over (action, world digest) of the executed prefix, hexadecimal; Base and
            Dynamic both arrived at it.
        base_digest: The same chain over the whole Base rollout.
        dynamic_digest: The same chain over the whole Dynamic rollout, event included.
        evidence: What the event found and left, and the mean absolute pixel change per camera (0 to 255).
        base_repeat: Where Base was played a second time for the noise floor: ``success``, and whether the
            rollout was ``identical`` bit for bit. None elsewhere.
        contacts: Entities touched by the target at the end of each rollout.
        policy: The policy's spec as played.
        fingerprints: Everything else that could change a result: versions, substrate, assets.
        timings: Wall-clock seconds; the only fields that differ between runs.
    """

    case_id: str
    item_id: str
    case_digest: str
    source: str
    source_category: str
    difficulty: int | None
    suite: str
    task_index: int
    init_state_index: int
    policy_seed: int
    instruction: str
    event: str
    family: str
    variant: int
    severity: str
    trigger_entity: str
    base_success: bool
    dynamic_success: bool
    base_steps: int
    dynamic_steps: int
    max_steps: int
    trigger_step: int | None
    trigger_distance_m: float | None
    min_distance_m: float
    response_step: int | None
    stale_actions: int | None
    base_queries: int
    dynamic_queries: int
    prefix_digest: str | None
    base_digest: str
    dynamic_digest: str | None
    evidence: Json | None
    contacts: Json
    policy: Json
    fingerprints: Json
    base_repeat: Json | None = None
    timings: Json = field(default_factory=dict)
    schema_version: int = RECORD_VERSION

    @property
    def triggered(self) -> bool:
        return self.trigger_step is not None

    @property
    def responded(self) -> bool:
        return self.response_step is not None

    @property
    def outcome(self) -> str:
        """One of :data:`OUTCOMES`."""
        return OUTCOMES[
            (0 if self.dynamic_success else 2) if self.base_success else (1 if self.dynamic_success else 3)
        ]

    def to_dict(self) -> Json:
        """JSON types only, ``schema_version`` first."""
        values = asdict(self)
        return {"schema_version": values.pop("schema_version"), **values}

    def identity(self) -> Json:
        """Everything but the timings."""
        values = self.to_dict()
        del values["timings"]
        return values

    @classmethod
    def from_dict(cls, values: Json) -> PairRecord:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: A field is missing or unknown, or the schema version is not ours.
        """
        version = values.get("schema_version")
        if version != RECORD_VERSION:
            raise ReportError(
                f"schema_version={version!r} of a pair record, but this version reads {RECORD_VERSION}. "
                "Read it with the version of pytest-libero-max that wrote it."
            )
        require_fields(cls, values, "pair record")
        return cls(**values)


def require_fields(cls: type[Any], values: Json, what: str) -> None:
    """Check that a stored object has exactly the fields of its dataclass.

    Args:
        cls: The dataclass.
        values: The object as read.
        what: How to name it in an error.

    Raises:
        ReportError: A field is missing or unknown.
    """
    known = {item.name for item in fields(cls)}
    for key in values:
        if key not in known:
            raise ReportError(f"A {what} has the unknown field {key!r}. {did_you_mean(key, known)}")
    missing = sorted(known - values.keys())
    if missing:
        raise ReportError(f"{what.capitalize()} {values.get('case_id')!r} lacks {', '.join(missing)}.")


@dataclass(frozen=True)
class PairError:
    """A pair that could not be measured: an error of the machinery, never a failure of the policy.

    Attributes:
        kind: Name of the exception class.
        message: What it said.
        phase: ``setup``, ``base``, ``dynamic`` or ``crash``.
    """

    case_id: str
    item_id: str
    case_digest: str
    kind: str
    message: str
    phase: str
    schema_version: int = RECORD_VERSION

    def to_dict(self) -> Json:
        values: dict[str, Any] = asdict(self)
        return {"schema_version": values.pop("schema_version"), **values}

    @classmethod
    def of(cls, case: Case, error: BaseException, phase: str) -> PairError:
        return cls(case.case_id, case.item_id, case.digest, type(error).__name__, str(error), phase)

    @classmethod
    def from_dict(cls, values: Json) -> PairError:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: It has other fields or another schema version.
        """
        if values.get("schema_version") != RECORD_VERSION:
            raise ReportError(
                f"schema_version={values.get('schema_version')!r}, but this version reads {RECORD_VERSION}."
            )
        known = {item.name for item in fields(cls)}
        if values.keys() != known:
            raise ReportError(f"A pair error has the fields {sorted(values)}, but must have {sorted(known)}.")
        return cls(**values)


def is_error(values: Json) -> bool:
    """Whether a stored result is a :class:`PairError`; otherwise it is a :class:`PairRecord`."""
    return "kind" in values


def result_from_dict(values: Json) -> PairRecord | PairError:
    """Read what either ``to_dict`` wrote.

    Raises:
        ReportError: See the two ``from_dict``.
    """
    return PairError.from_dict(values) if is_error(values) else PairRecord.from_dict(values)
