"""Registry of event kinds, and checks of the events of manifests."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case, Event
from pytest_libero_max.errors import ChangeError, ManifestError, did_you_mean
from pytest_libero_max.events.kind import VARIANTS, EventKind, accept_kind
from pytest_libero_max.events.schedules import arms_of, trigger_of
from pytest_libero_max.registry import Registry, classes_in

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata

BENCHMARK_EVENTS = (
    "illumination_switch",
    "camera_shift",
    "visual_theme_switch",
    "sensor_noise_onset",
    "target_relocation",
    "receptacle_relocation",
    "distractor_burst",
    "obstacle_insertion",
)
"""The paper's eight events, in its order. The frozen tracks hold these and no others."""

BENCHMARK_FAMILIES = ("geometry", "observation", "appearance_and_clutter", "path_constraint")
"""The paper's four families, in its order."""

EVENTS: Registry[EventKind] = Registry(
    "event",
    "pytest_libero_max.events",
    classes_in("pytest_libero_max.events.kinds", EventKind, first=BENCHMARK_EVENTS),
    accept_kind,
    ManifestError,
    attribute="name",
)
"""Every event kind by name: the benchmark's eight first, then the others."""


def families() -> tuple[str, ...]:
    """Return the families of all events: the benchmark's, then the others in the order of their events."""
    return tuple(dict.fromkeys((*BENCHMARK_FAMILIES, *(kind.family for kind in EVENTS.values()))))


def family_of(event: str) -> str:
    """Return the family of an event, or raise ManifestError."""
    return EVENTS[event].family


def eligible(event: str, task: TaskMetadata) -> bool:
    """Return True if ``task`` has what ``event`` needs, or raise ManifestError."""
    return event not in task.impossible and EVENTS[event].eligible(task)


def eligible_events(task: TaskMetadata) -> tuple[str, ...]:
    """Return the events that ``task`` can host, in the registry's order."""
    return tuple(event for event in EVENTS if eligible(event, task))


def resolve_event(name: str, variant: int, task: TaskMetadata, identity: Identity) -> Event:
    """Fix every parameter of an event for a task, or raise ManifestError.

    Args:
        name: One of :data:`EVENTS`.
    """
    kind = EVENTS[name]
    if variant not in VARIANTS:
        raise ManifestError.seen("variant", variant, ", but an event has the variants 0 and 1.")
    if not eligible(name, task):
        needs = task.impossible.get(name, f"The task needs {kind.needs}")
        raise ManifestError.seen(
            "event",
            name,
            f" is not possible in {task.name!r}. {needs} "
            f"Possible: {', '.join(eligible_events(task)) or 'none'}.",
        )
    scenario = kind.resolve(variant, task, identity)
    return kind.event(variant, identity.seed(name, variant), scenario, kind.trigger(task))


def check_cases(cases: Iterable[Case]) -> None:
    """Check that every case of a manifest is one of an event that exists, before anything is played.

    The event is registered, the case has its kind's family code, severity and response, and every change,
    setup and trigger can be built, those of its program included.

    Raises:
        ManifestError: A case is not; names it.
    """
    from pytest_libero_max.changes import check_changes

    cases = tuple(cases)
    for case in cases:
        _check_event(case.event, f"case {case.case_id!r}: scenario")
    check_changes(cases)
    for case in cases:
        if not case.needs_format_2:
            continue  # its one trigger and change are checked already
        if case.program is not None and not case.fits(case.program):
            raise ManifestError(
                f"case {case.case_id!r}: its program {case.program.name!r} does not fit it: "
                f"{case.program.because}"
            )
        try:
            trigger_of(case)
            arms_of(case)
        except (ManifestError, ChangeError) as error:
            raise ManifestError(f"case {case.case_id!r}: {error}") from error


def _check_event(event: Event, where: str) -> None:
    if event.name not in EVENTS:
        raise ManifestError.seen(
            f"{where}.change_type", event.name, f" is not an event. {did_you_mean(event.name, EVENTS)}"
        )
    kind = EVENTS[event.name]
    if event.family_code != kind.code:
        raise ManifestError.seen(
            f"{where}.change_family", event.family_code, f", but {kind.name} belongs to {kind.code!r}."
        )
    severity = kind.severities[event.variant]
    if event.severity != severity:
        raise ManifestError.seen(
            f"{where}.severity",
            event.severity,
            f", but variant {event.variant} of {kind.name} has the severity {severity!r}.",
        )
    if event.response != kind.response:
        raise ManifestError.seen(
            f"{where}.expected_response_mode", event.response, f", but {kind.name} expects {kind.response!r}."
        )
