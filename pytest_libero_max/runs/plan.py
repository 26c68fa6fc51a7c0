"""The plan of a run: the planned pairs, which stay in every denominator, and the provenance."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from typing import Annotated, ClassVar

from msgspec.structs import force_setattr

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json, slug
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.benchmark.structs import (
    AnyText,
    Difficulty,
    Document,
    FileName,
    Flag,
    Name,
    Object,
    Positive,
    Sha256,
    SourceName,
    Text,
    Texts,
    Variant,
    convert,
    require_plain,
    rule,
    to_builtins,
)
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import family_of
from pytest_libero_max.pairing.record import RECORD_VERSION, Version, require_version
from pytest_libero_max.runs.protocol import renamed, require_settings

Moment = Annotated[
    str,
    rule(
        "a time such as 2026-11-25T10:00:00+00:00",
        pattern=r"^20[0-9]{2}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\+00:00$(?!\n)",
    ),
]

OUTSIDE = "outside"
"""The ``code`` of a policy that another evaluation loop plays (:class:`~pytest_libero_max.gym.PairedRun`)."""

OBJECT = "object"
"""The ``code`` of a policy that was an object of a program (:func:`pytest_libero_max.evaluate`)."""

_MOST_LEVELS = 16
"""Most lists and objects in each other in the provenance: it holds programs, and these changes."""

_UNKNOWN = "?"
"""The number of a task that is not known."""


class PlannedPair(Document, frozen=True, kw_only=True):
    """The identity of a case, and every label by which results are grouped."""

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
    event: Name
    """Name of the case's event."""
    family: Name
    """The event's family."""
    variant: Variant
    """The event's parameter variant, 0 or 1."""
    severity: Name
    """The event's severity."""
    task: Name = _UNKNOWN  # not always written
    """The LIBERO task that the case is of or is a variation of, for example ``libero_goal/3``;
    ``libero_goal/?`` where that is not known."""

    def __post_init__(self) -> None:
        if self.task == _UNKNOWN:
            force_setattr(self, "task", f"{self.suite}/{_UNKNOWN}")

    @property
    def category(self) -> str:
        """Source and source category as one word, for example ``plus-camera_viewpoints``."""
        return f"{self.source}-{slug(self.source_category)}"

    @property
    def event_variant(self) -> str:
        """Event and parameter variant as one word, for example ``camera_shift-v1``."""
        return f"{self.event}-v{self.variant}"

    @property
    def program(self) -> str:
        """Name of the program that the pair plays, with which its item id ends; empty where it has none."""
        return self.item_id.partition(f"-{self.event_variant}-")[2]

    @classmethod
    def of(cls, case: Case) -> PlannedPair:
        return cls(
            case_id=case.case_id,
            item_id=case.item_id,
            case_digest=case.digest,
            source=case.source,
            source_category=case.source_category,
            difficulty=case.difficulty,
            suite=case.suite,
            event=case.event.name,
            family=family_of(case.event.name),
            variant=case.event.variant,
            severity=case.event.severity,
            task=f"{case.suite}/{task_number(case)}",
        )


def unsupported_pairs(planned: Iterable[PlannedPair], policy: Json | None) -> list[PlannedPair]:
    """Return the planned pairs whose suite a policy declares that it does not support."""
    suites = None if policy is None else policy.get("suites")
    return [] if suites is None else [pair for pair in planned if pair.suite not in suites]


class Substrate(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The substrate of a run, as far as it is read again."""

    name: Text
    installations: Texts = ()
    roots: Texts = ()
    assets: Text | None = None
    semantics: Text | None = None
    instruction_source: Text | None = None
    source_variations: Text | None = None
    images: Text | None = None


class CaseSet(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The case set of a run, as far as it is read again."""

    name: Text
    digest: Text
    limit: Positive | None = None
    path: Text | None = None
    program: Text | None = None
    study: Text | None = None
    released_as: Text | None = None


class AskedPolicy(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The policy of a run as the user asked for it, with settings of the part ``policy``."""

    reference: Text
    code: Text | None = None


class Scores(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """Standing of a run's scores; older runs know their substrate by its name alone."""

    comparable_with_published: Flag | None
    note: Text | None


class Git(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """State of the repository that a run was started in."""

    commit: Text
    dirty: Flag


class Provenance(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """Fields of the provenance that reports read; a run may hold more, see :mod:`.provenance`."""

    NOUN: ClassVar[str] = "provenance"

    versions: dict[str, Text | None]
    platform: Object
    substrate: Substrate
    case_set: CaseSet
    policy: AskedPolicy
    protocol: Object
    command: Texts
    started: Moment | None = None
    git: Git | None = None
    gl_backend: AnyText | None = None
    fingerprint: Text | None = None
    order: Text | None = None
    stopping_rule: Text | None = None
    gates: Texts | None = None
    scores: Scores | None = None


class Run(Document, frozen=True, tag_field="line", tag="run"):
    """A run before its first pair."""

    NOUN: ClassVar[str] = "run"

    planned: tuple[PlannedPair, ...]
    """Every assigned pair, in the order of play."""
    provenance: Object
    """Origin of the run; see :func:`~pytest_libero_max.runs.provenance.collect`."""
    schema_version: Version = RECORD_VERSION

    def __post_init__(self) -> None:
        seen: set[str] = set()
        for pair in self.planned:
            if pair.case_id in seen:
                raise ReportError(f"case_id={pair.case_id!r} is planned twice; a case is played once a run.")
            seen.add(pair.case_id)

    @classmethod
    def of(cls, cases: Iterable[Case], provenance: Json) -> Run:
        return cls(tuple(PlannedPair.of(case) for case in cases), provenance)

    def to_dict(self) -> Json:
        """Return JSON types only, the plan last."""
        values = to_builtins(self)
        return {name: values[name] for name in ("schema_version", "provenance", "planned")}

    @classmethod
    def from_dict(cls, values: Json) -> Run:
        """Read what :meth:`to_dict` wrote, or raise ReportError."""
        require_version(values, "run")
        run = convert(values, cls)
        require_plain(run.provenance, "provenance", _MOST_LEVELS)
        started = convert(run.provenance, Provenance).started
        run.provenance["policy"] = renamed(run.provenance["policy"])
        require_settings(run.provenance)
        try:
            datetime.fromisoformat(started or "2000-01-01")
        except ValueError as error:
            raise ReportError.seen("provenance.started", started, f" is no time: {error}.") from None
        if "selection" in run.provenance:
            Selection.from_dict(run.provenance["selection"]).require(pair.case_id for pair in run.planned)
        return run


def task_number(case: Case) -> str:
    """Return the index of the task in its suite; LIBERO-Plus numbers variations, named after their task."""
    if case.source != "plus":
        return str(case.task_index)
    from pytest_libero_max.tasks.libero_tasks import SUITES, tasks

    name = f"{case.record.get('task_name', '')}_"
    suite = tasks(case.suite) if case.suite in SUITES else ()
    known = [index for index, task in enumerate(suite) if name.startswith(f"{task.name}_")]
    return str(known[0]) if len(known) == 1 else _UNKNOWN
