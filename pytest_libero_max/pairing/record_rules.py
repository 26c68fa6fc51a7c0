"""Rules on pair records that types alone do not say; each is checked when a record is read.

What passes can be reported, compared, exported and filmed, so no reader of a record checks it again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar

from msgspec import Meta, field
from msgspec.structs import replace

from pytest_libero_max.benchmark.cases import step_budget
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import CHANGED_BY, NO_LATENCY, PATTERN, Latency
from pytest_libero_max.benchmark.structs import (
    LARGEST,
    Count,
    Distance,
    Document,
    Finite,
    Flag,
    Name,
    Plain,
    Positive,
    Text,
    Texts,
    convert,
    rule,
    shown,
)
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.probe_columns import require_columns

ArmRecord: TypeAlias = Any
PairRecord: TypeAlias = Any
"""The structs of :mod:`.record`, which imports this module."""

Record = TypeVar("Record", bound=Any)

COMPONENTS, CONTROL_HZ = 7, 20
"""Components of an action and control steps a second of LIBERO's robot, which records leave out; spelled here
because records are read where no simulator is."""

QUERY_MS = "query_ms"
"""Among the timings of a pair: numbers of queries by their milliseconds, by arm."""

SERVER = "server"
"""Among the timings of a pair: the address of the server that answered."""

Milliseconds = Annotated[str, Meta(pattern=r"^[0-9]+(\.[0-9]+)?(e[+-]0[0-9])?$")]
if TYPE_CHECKING:
    Timing = Any
else:
    Timing = Distance | str | dict[str, Annotated[dict[Milliseconds, Count], Meta(min_length=1)]]
    """Seconds, the address of a server, or numbers of queries by their milliseconds, by arm."""

FileIdentities = Annotated[
    dict[Name, dict[Name, Count | Text]],
    rule("files by name, each with numbers and texts that identify it"),
]

Point = Annotated[tuple[Finite, ...], rule("three numbers", min_length=3, max_length=3)]

_LATENCY = re.compile(PATTERN)


class PlayedPolicy(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The spec of a policy as a record holds it; see :class:`~pytest_libero_max.PolicySpec`."""

    NOUN: ClassVar[str] = "policy of a pair record"

    name: Name
    horizon: Positive
    query_interval: Positive
    privileged: Flag
    cameras: Texts = ()
    image_size: (
        Positive | Annotated[tuple[Positive, ...], rule("height and width", min_length=2, max_length=2)]
    ) = 1
    repeatable: Flag = True
    revision: Text | None = None
    suites: Annotated[tuple[Name, ...], rule("a list of suites", min_length=1)] | None = None
    control: Literal["delta", "absolute"] = "delta"
    wrappers: Texts = ()
    memory: Text | None = None
    history: Flag = False
    files: FileIdentities = field(default_factory=dict)
    reset_files: FileIdentities = field(default_factory=dict)


class Measured(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The values before or after a change that causes and films read."""

    position_m: Annotated[dict[str, Point] | list[Plain] | None, rule("three numbers for each object")] = None
    taken_out: Texts = ()


class Evidence(Document, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """The evidence of a change; see :class:`~pytest_libero_max.changes.Evidence`."""

    NOUN: ClassVar[str] = "evidence"

    operation: Text
    factors: Texts = ()
    before: Measured = Measured()
    after: Measured = Measured()
    pixel_change: dict[str, Distance] = field(default_factory=dict)


def require_consistent(record: Record) -> Record:
    """Return a record whose fields agree, or raise ReportError."""
    for name, arm in record.arms.items():
        try:
            require_consistent_arm(arm)
        except ReportError as error:
            raise ReportError(f"arm {name!r} of {record.item_id!r}: {error}") from None
    try:
        _require_consistent_pair(record)
    except ReportError as error:
        raise ReportError(f"{record.item_id!r}: {error}") from None
    return record


def require_consistent_arm(arm: ArmRecord) -> None:
    """Check that the fields of an arm about its event agree, or raise ReportError."""
    if not all(_is_entry(entry, arm.schedule[:index]) for index, entry in enumerate(arm.schedule)):
        raise ReportError(
            f"schedule={shown(list(arm.schedule))} of the arm, but must be a list of entries with a trigger, "
            "and a change or a reversal of an earlier one."
        )
    changes = [entry.get("change", {}) for entry in arm.schedule]
    delayed = [one.get("latency") for one in changes if one.get("operation") == CHANGED_BY]
    if (arm.latency is None and not delayed) != (arm.held_steps is None):
        raise ReportError(
            f"latency={shown(arm.latency)} and held_steps={arm.held_steps} of an arm, but it has both "
            "or neither."
        )
    _require_counts(arm)
    require_columns(arm.probes, arm.steps)
    if len(arm.firings) > len(arm.schedule):
        raise ReportError(
            f"{counted(len(arm.firings), 'firing')} of an arm whose schedule has "
            f"{counted(len(arm.schedule), 'entry', 'entries')}."
        )
    if not arm.firings:
        if arm.response_step is not None or arm.stale_actions is not None:
            raise ReportError(
                f"response_step={arm.response_step} and stale_actions={arm.stale_actions} of an arm in which "
                "nothing happened, but must be null."
            )
        return
    moments = [firing.step for firing in arm.firings]
    if moments != sorted(moments) or moments[-1] > arm.steps:
        raise ReportError(
            f"Firings at the steps {moments} of an arm of {counted(arm.steps, 'step')}, in this order."
        )
    asked = [firing.queries for firing in arm.firings]
    if asked != sorted(asked) or asked[-1] > arm.queries:
        raise ReportError(f"Firings after {asked} queries of an arm of {arm.queries}, in this order.")
    for firing in arm.firings:
        convert(firing.evidence, Evidence)
    event = moments[0]
    if arm.response_step is not None and not event <= arm.response_step <= arm.steps:
        raise ReportError(
            f"response_step={arm.response_step}, but the event was at step {event} and the arm took "
            f"{counted(arm.steps, 'step')}: a response comes after the event."
        )
    delays = _delays([arm.latency, *delayed]) if delayed or arm.latency is not None else [0]
    answered = arm.steps if arm.response_step is None else arm.response_step
    ends = {min(arm.steps, answered + delay) for delay in delays}
    stale = sorted(end - event for end in ends)
    if arm.stale_actions not in stale:
        late = f" whose answer takes {_either(delays)} of the steps" if any(delays) else ""
        raise ReportError(
            f"stale_actions={arm.stale_actions}, but {_either(stale)} actions were executed between the "
            f"event (step {event}) and the next query{late} (response_step={arm.response_step}, "
            f"steps={arm.steps})."
        )


def _either(values: Sequence[int]) -> str:
    return " or ".join(map(str, values))


def _delays(texts: Sequence[Any]) -> list[int]:
    """Return the delays of some latencies; none is as good as no latency."""
    known = [text for text in texts if isinstance(text, str) and _LATENCY.search(text)]
    latencies = [*map(Latency.parse, known), *([NO_LATENCY] if len(known) < len(texts) else [])]
    return sorted({delay for latency in latencies for delay in latency.delays})


def _require_counts(arm: ArmRecord) -> None:
    """Check the counts of an arm against its steps."""
    steps, held = arm.steps, arm.held_steps or 0
    if arm.queries > steps + 1 or arm.clipped_components > arm.components * steps or held > steps:
        raise ReportError(
            f"queries={arm.queries}, clipped_components={arm.clipped_components} and held_steps={held} of an "
            f"arm of {counted(steps, 'step')}, but there is one query a step at most, and "
            f"{counted(arm.components, 'component')}."
        )
    if arm.returned is not None and arm.returned[0] > arm.returned[1]:
        raise ReportError(f"returned={list(arm.returned)} of an arm, but the smallest number comes first.")


def _require_consistent_pair(record: PairRecord) -> None:
    """Check that the arms of a record agree with each other, or raise ReportError."""
    _require_policy(record)
    _require_timings(record.timings)
    budget = step_budget(record.suite)
    if budget is not None and record.max_steps > budget:
        raise ReportError(
            f"max_steps={record.max_steps}, but an episode of {record.suite} has {budget}. Something has "
            "changed the budgets where the pair was played: look for it in the adapter."
        )
    for name, arm in record.arms.items():
        if arm.steps > record.max_steps:
            raise ReportError(f"steps={arm.steps} of arm {name!r}, but max_steps={record.max_steps}.")
        if arm.shares is not None:
            _require_shared(record, name, arm)
    missing = [name for name in (BASE, DYNAMIC) if name not in record.arms]
    if missing:
        raise ReportError(f"the arms are {list(record.arms)}, but a pair has {missing[0]!r} as well.")
    base, dynamic = record.arms[BASE], record.arms[DYNAMIC]
    if base.schedule or base.firings:
        raise ReportError(f"arm {BASE!r} has an event, but nothing happens in Base.")
    event = record.trigger
    if event is None:
        if (base.success, base.proof) != (dynamic.success, dynamic.proof):
            raise ReportError("the event never came, but Base and Dynamic differ.")
    elif event.step > record.base_steps or event.queries > dynamic.queries:
        raise ReportError(
            f"the event came after {counted(event.step, 'step')} and "
            f"{counted(event.queries, 'query', 'queries')}, but Base took "
            f"{counted(record.base_steps, 'step')} and Dynamic "
            f"{counted(dynamic.queries, 'query', 'queries')}."
        )


def _require_shared(record: PairRecord, name: str, arm: ArmRecord) -> None:
    """Check that an arm that was not played is the earlier arm that it names."""
    names = list(record.arms)
    earlier = names[: names.index(name)]
    if arm.shares not in earlier:
        raise ReportError(f"shares={arm.shares!r} of arm {name!r}, but the arms before it are {earlier}.")
    if arm != replace(record.arms[arm.shares], schedule=arm.schedule, shares=arm.shares):
        raise ReportError(f"arm {name!r} differs from {arm.shares!r}, which it says it shares.")


def _is_entry(value: Json, earlier: Sequence[Json]) -> bool:
    """Return True if this is an entry of a schedule after others, as ``Entry.to_dict`` writes it."""
    if not _named(value.get("trigger"), "type"):
        return False
    if value.keys() == {"trigger", "change"}:
        return _named(value["change"], "operation")
    if value.keys() != {"trigger", "reverts"} or not _is_count(value["reverts"]):
        return False
    return value["reverts"] < len(earlier) and "change" in earlier[value["reverts"]]


def _named(value: Any, key: str) -> bool:
    return type(value) is dict and type(value.get(key)) is str


def _is_count(value: Any, least: int = 0) -> bool:
    return type(value) is int and least <= value <= LARGEST


def _require_policy(record: PairRecord) -> None:
    """Check the spec of each policy, and that it plays the pair's suite."""
    for spec in (record.policy, *(arm.policy for arm in record.arms.values() if arm.policy is not None)):
        policy = convert(spec, PlayedPolicy)
        if policy.query_interval > policy.horizon:
            raise ReportError(
                f"query_interval={policy.query_interval} of the policy, but horizon={policy.horizon}: Q <= H."
            )
        if policy.suites is not None and record.suite not in policy.suites:
            raise ReportError(f"suite={record.suite!r}, but the policy plays {list(policy.suites)} alone.")


def _require_timings(timings: Mapping[str, object]) -> None:
    """Check that timings are numbers, but for the address of a server and the times of queries."""
    kinds: dict[str, tuple[type, ...]] = {QUERY_MS: (dict,), SERVER: (str,)}
    for name, value in timings.items():
        if type(value) not in kinds.get(name, (float, int)):
            raise ReportError(
                f"timings.{name}={shown(value)}, but must be a number; {SERVER!r} is an address, and "
                f"{QUERY_MS!r} has numbers of queries."
            )
