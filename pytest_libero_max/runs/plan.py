"""What a run set out to measure: the planned pairs, which stay in every denominator."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json, slug
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.costs.model import Kind
from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import family_of
from pytest_libero_max.pairing.fields import (
    ANY_TEXT,
    COUNT,
    OBJECT,
    POSITIVE,
    SHARE,
    TEXT,
    TEXTS,
    Rule,
    check_fields,
    listed,
    shown,
)
from pytest_libero_max.pairing.record import RECORD_VERSION, require_version
from pytest_libero_max.pairing.record_checks import IDENTITY

_UNKNOWN = "?"
"""The number of a task that is not known."""


@dataclass(frozen=True)
class PlannedPair:
    """The identity of a case, and every label by which results are grouped.

    Attributes:
        case_id: Unique in the manifest.
        item_id: Name of the test item.
        case_digest: SHA-256 of the case.
        source: Where the case comes from: ``plus``, ``pro``, or ``libero`` for an unmodified task.
        source_category: Category of the source variation; ``Unmodified`` for an unmodified task.
        difficulty: LIBERO-Plus difficulty 1 to 5, or None.
        suite: LIBERO suite.
        event: Name of the case's event.
        family: The event's family.
        variant: The event's parameter variant, 0 or 1.
        severity: The event's severity.
        task: The LIBERO task that the case is of or is a variation of, for example ``libero_goal/3``;
            ``libero_goal/?`` where that is not known.
    """

    case_id: str
    item_id: str
    case_digest: str
    source: str
    source_category: str
    difficulty: int | None
    suite: str
    event: str
    family: str
    variant: int
    severity: str
    task: str

    @property
    def category(self) -> str:
        """Source and source category as one word, for example ``plus-camera_viewpoints``."""
        return f"{self.source}-{slug(self.source_category)}"

    @property
    def event_variant(self) -> str:
        """Event and parameter variant as one word, for example ``camera_shift-v1``."""
        return f"{self.event}-v{self.variant}"

    @property
    def kind(self) -> Kind:
        """What its cost is expected from."""
        return Kind(self.suite, self.task, self.event)

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
            task=f"{case.suite}/{_task_number(case)}",
        )


def unsupported_pairs(planned: Iterable[PlannedPair], policy: Json | None) -> list[PlannedPair]:
    """The planned pairs whose suite a policy declares that it does not support.

    Args:
        planned: Planned pairs.
        policy: The policy's spec as played, None where no pair was.
    """
    suites = None if policy is None else policy.get("suites")
    return [] if suites is None else [pair for pair in planned if pair.suite not in suites]


@dataclass(frozen=True)
class Run:
    """A run before its first pair.

    Attributes:
        planned: Every assigned pair, in the order of play.
        provenance: Where and how it is played; see :func:`~pytest_libero_max.runs.provenance.collect`.
    """

    planned: tuple[PlannedPair, ...]
    provenance: Json

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
        return {
            "schema_version": RECORD_VERSION,
            "provenance": self.provenance,
            "planned": [asdict(pair) for pair in self.planned],
        }

    @classmethod
    def from_dict(cls, values: Json) -> Run:
        """Read what :meth:`to_dict` wrote.

        Raises:
            ReportError: It has another form or another schema version, or lacks what reports read of it.
        """
        require_version(values, "run")
        check_fields(values, _RUN, "run")
        for name, part in _PROVENANCE.items():
            _check_part(values["provenance"], name, part)
        for name, rule in _SESSION.items():
            _require(f"provenance.{name}", values["provenance"].get(name), rule)
        if "scores" in values["provenance"]:  # older runs know their substrate by its name alone
            _check_part(values["provenance"], "scores", _SCORES)
        if "selection" in values["provenance"]:
            Selection.from_dict(values["provenance"]["selection"])
        return cls(tuple(map(planned_pair, values["planned"])), values["provenance"])


def _task_number(case: Case) -> str:
    """Which of the ten tasks of its suite a case is of. LIBERO-Plus numbers variations, named after it."""
    if case.source != "plus":
        return str(case.task_index)
    from pytest_libero_max.tasks.libero_tasks import SUITES, tasks

    name = f"{case.record.get('task_name', '')}_"
    suite = tasks(case.suite) if case.suite in SUITES else ()
    known = [index for index, task in enumerate(suite) if name.startswith(f"{task.name}_")]
    return str(known[0]) if len(known) == 1 else _UNKNOWN


def planned_pair(values: Json) -> PlannedPair:
    """A planned pair as stored. Its task was not always written.

    Raises:
        ReportError: Another field is missing or unknown, or a value is none that it can hold.
    """
    values = {"task": f"{values.get('suite')}/{_UNKNOWN}", **values}
    return PlannedPair(**check_fields(values, _PLANNED, "planned pair"))


def _check_part(provenance: Json, name: str, rules: Mapping[str, Rule]) -> None:
    """Check the fields of a part of the provenance that reports read; it may have more."""
    part: Any = provenance.get(name)
    _require(f"provenance.{name}", part, OBJECT)
    for key, rule in rules.items():
        _require(f"provenance.{name}.{key}", part.get(key), rule)


def _require(name: str, value: object, rule: Rule) -> None:
    if not rule.holds(value):
        raise ReportError(f"{name}={shown(value)} of a run, but must be {rule.words}.")


_PLANNED = {**IDENTITY, "task": TEXT}
_RUN = {"schema_version": COUNT, "provenance": OBJECT, "planned": listed("objects", OBJECT.holds)}
_PROVENANCE: Mapping[str, Mapping[str, Rule]] = {
    "versions": {},
    "platform": {},
    "substrate": {"name": TEXT},
    "case_set": {"name": TEXT, "digest": TEXT},
    "policy": {
        "reference": TEXT,
        "horizon": POSITIVE.or_null,
        "query_interval": POSITIVE.or_null,
        "restore": TEXT.or_null,
        "adaptive": TEXT.or_null,
    },
    "protocol": {
        "noise_floor": POSITIVE.or_null,
        "strength": SHARE.or_null,
        "study": OBJECT.or_null,
        "program": OBJECT.or_null,
    },
}


_SCORES = {
    "comparable_with_published": Rule("true, false or null", lambda value: value in (True, False, None)),
    "note": TEXT.or_null,
}


def _is_git(value: Any) -> bool:
    return type(value) is dict and TEXT.holds(value.get("commit")) and type(value.get("dirty")) is bool


_GIT = Rule("an object with a commit, and whether files differ from it", _is_git)
_SESSION = {
    "started": TEXT.or_null,
    "git": _GIT.or_null,
    "gl_backend": ANY_TEXT.or_null,
    "command": TEXTS,
    "order": TEXT.or_null,
    "stopping_rule": TEXT.or_null,
}
"""What reports read of the provenance: its parts, and what pytest was started with."""
