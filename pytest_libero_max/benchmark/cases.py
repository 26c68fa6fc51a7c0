"""Cases: the frozen benchmark units. Pure data, in the format of the manifests of LIBERO-MAX's authors.

A case of the authors is one event at one trigger; a ``program`` says more (:mod:`.programs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

from msgspec import Struct

from pytest_libero_max.benchmark.documents import Json, canonical_digest, slug
from pytest_libero_max.benchmark.programs import Program, parse_program
from pytest_libero_max.benchmark.structs import (
    Count,
    Difficulty,
    Length,
    Name,
    Variant,
    Word,
    checked,
    rule,
)
from pytest_libero_max.benchmark.suites import SUITES, VARIED
from pytest_libero_max.errors import ManifestError

UNMODIFIED = "Unmodified"
"""Source category of an unmodified task."""


def step_budget(suite: str) -> int | None:
    """Return the policy steps of an episode of a suite after the settle steps; None for no known suite."""
    return SUITES[suite].budget if suite in SUITES else None


SETTLE_STEPS = 10
"""Control steps with the no-op action before the first query."""

TRIGGER_DISTANCE_M = 0.18

INTENT = "INTENT"
"""Family code of the events in which the task itself changes."""


PROXIMITY = "on_proximity"
"""Type of the trigger of every case of the authors."""


@dataclass(frozen=True)
class Event:
    """A change in the middle of an episode."""

    name: str
    variant: int
    """Parameter variant, 0 or 1 (``draw_id`` in the manifests)."""
    seed: int
    """Scenario seed; whatever an event draws at run time is drawn from it."""
    severity: str
    """``low``, ``medium`` or ``high``."""
    family_code: str
    """The manifests' code of the event's family, for example ``OBS`` (``change_family``)."""
    response: str
    """Expected response of a policy: ``continue`` or ``replan``, or where the instruction changes
    ``follow_update`` or ``stop`` (``expected_response_mode``)."""
    change: Json
    """The change as the manifest spells it: an ``operation`` and its parameters."""
    setup: tuple[Json, ...]
    """Changes both arms share, applied right after reset."""
    trigger: Json
    """Moment of the change, as the manifest spells it: a ``type`` and its parameters, among them the name of
    an entity in ``value``."""

    @property
    def entity(self) -> str:
        """The entity that the trigger names; distances and contacts of every arm are about it."""
        return str(self.trigger["value"])


@dataclass(frozen=True, repr=False)
class Case:
    """One frozen unit of the benchmark; the evaluation of a case is a pair of rollouts."""

    case_id: str
    """Unique in its manifest."""
    suite: str
    task_index: int
    """Index in the source's own registry (LIBERO-Plus: its long list; otherwise 0 to 9)."""
    init_state_index: int
    policy_seed: int
    """Seed of the policy, the same in both rollouts."""
    event: Event
    """The one change of the Dynamic rollout."""
    source: str
    """``plus``, ``pro``, or the benchmark of an unmodified task, for example ``libero``."""
    source_category: str
    """Category of the source variation; ``Unmodified`` for an unmodified task."""
    difficulty: int | None
    """LIBERO-Plus difficulty 1 to 5, or None."""
    instruction: str | None
    """Prompt fixed by the manifest, or None where the substrate's task gives it."""
    record: Json
    """The case exactly as its manifest spells it."""
    program: Program | None = None
    """The arms of the case, where its manifest spells them out. None: nothing happens in Base, the event in
    Dynamic."""

    def __hash__(self) -> int:
        return hash(self.case_id)

    def __repr__(self) -> str:
        """Return a short text: other plugins write it into their reports, as the parameter of a test."""
        return f"<Case {self.item_id}>"

    @property
    def unmodified(self) -> bool:
        """True if the task is as its benchmark has it, without a source variation."""
        return self.source not in VARIED

    @property
    def budget(self) -> int:
        """Policy steps after the settle steps."""
        budget = step_budget(self.suite)
        assert budget is not None  # reading a case refuses an unknown suite
        return budget

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON of the case, hexadecimal."""
        return canonical_digest(self.record)

    @property
    def item_id(self) -> str:
        """Name of the case's test item, for example ``libero-spatial-t00-i00-camera_shift-v1``.

        It ends with the name of the case's program where it has one.
        """
        suite, width = SUITES[self.suite], 4 if self.source == "plus" else 2
        varied = f"{self.source}-{slug(self.source_category)}"
        origin = suite.benchmark if self.unmodified else varied
        program = "" if self.program is None else f"-{self.program.name}"
        return (
            f"{origin}-{suite.label}-t{self.task_index:0{width}d}-i{self.init_state_index:02d}"
            f"-{self.event.name}-v{self.event.variant}{program}"
        )

    @property
    def needs_format_2(self) -> bool:
        """True if the authors' format cannot express the case."""
        return self.program is not None or self.event.trigger["type"] != PROXIMITY

    def fits(self, program: Program) -> bool:
        """Return True if a program makes sense in the case, as far as the program says it."""
        return program.fits(
            event=self.event.name,
            operation=str(self.event.change["operation"]),
            suite=self.suite,
            entity=self.event.entity,
        )

    def playing(self, program: Program) -> Case:
        """Return the case with a program laid over it.

        Raises:
            ManifestError: It has one of its own.
        """
        if self.program is not None:
            raise ManifestError(
                f"case {self.case_id!r} has the program {self.program.name!r} already, so that "
                f"{program.name!r} cannot be laid over it. Leave the program out, or play other cases."
            )
        return replace(self, record={**self.record, "program": program.to_dict()}, program=program)


Severity = Literal["low", "medium", "high"]
SEVERITIES: tuple[str, ...] = get_args(Severity)

# A case as a manifest spells it.


class _Spelled(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of a manifest: exactly these fields."""


class _Operation(Struct, frozen=True):
    operation: Word


class _Trigger(Struct, frozen=True):
    type: Word
    value: Name


class _Proximity(_Spelled, frozen=True):
    type: Word
    value: Word
    distance_m: Length


class _Randomization(_Spelled, frozen=True):
    sampler: Word
    draw_id: Variant
    seed: Count


class _Scenario(_Spelled, frozen=True):
    scenario_id: Word
    base_task_id: Word
    seed: Count
    change_family: Word
    change_type: Word
    severity: Severity
    trigger: _Trigger
    change: _Operation
    expected_response_mode: Literal["continue", "replan", "follow_update", "stop"]
    """The first two of a case that is scored by the completion of its task, the others of one by intent."""
    safety_constraints: Annotated[tuple[Word, ...], rule("a list of non-empty strings")]
    setup: Annotated[tuple[_Operation, ...], rule("a list of changes")] = ()
    randomization: _Randomization = _Randomization(sampler="", draw_id=0, seed=0)


class _SourceVariant(_Spelled, frozen=True):
    language: Word
    benchmark: Word = ""
    category: Word = ""
    bddl_file: Word = ""
    init_states_file: Word = ""
    init_reference_bddl_file: Word = ""
    source_revision: Word = ""


class _Case(_Spelled, frozen=True):
    case_id: Name
    task_suite_name: Word
    task_index: Count
    init_state_index: Count
    policy_seed: Count
    timing_bucket: Literal["early", "middle", "late"]
    scenario: _Scenario
    task_name: Word = ""
    substrate_category: Name | None = None
    substrate_difficulty: Annotated[Difficulty | None, rule("null or 1 to 5")] = None
    substrate_variant: _SourceVariant | None = None
    dynamic_phase: Word = ""
    program: Any = None


def parse_case(record: Any, where: str = "case") -> Case:
    """Check one case of a manifest, or raise ManifestError."""
    named = record.get("case_id") if isinstance(record, dict) else None
    where = f"case {named!r}" if isinstance(named, str) and named else where
    spelled: _Case = checked(record, _Case, f"{where}: ", ManifestError)
    suite = spelled.task_suite_name
    if suite not in SUITES:
        raise ManifestError(f"{where}: task_suite_name={suite!r}. {SUITES.none_called(suite)}")
    source, category = _source(spelled.substrate_category, suite)
    return Case(
        case_id=spelled.case_id,
        suite=suite,
        task_index=spelled.task_index,
        init_state_index=spelled.init_state_index,
        policy_seed=spelled.policy_seed,
        event=_event(spelled.scenario, record["scenario"], f"{where}: scenario"),
        source=source,
        source_category=category,
        difficulty=spelled.substrate_difficulty,
        instruction=None if spelled.substrate_variant is None else spelled.substrate_variant.language,
        record=dict(record),
        program=parse_program(record["program"], f"{where}: program") if "program" in record else None,
    )


def _event(spelled: _Scenario, scenario: Json, where: str) -> Event:
    """Return the event of a scenario; of triggers beside ``on_proximity`` only the form is checked."""
    trigger = dict(scenario["trigger"])
    if spelled.trigger.type == PROXIMITY:
        proximity: _Proximity = checked(trigger, _Proximity, f"{where}.trigger", ManifestError)
        trigger["distance_m"] = proximity.distance_m
    return Event(
        name=spelled.change_type,
        variant=spelled.randomization.draw_id,
        seed=spelled.seed,
        severity=spelled.severity,
        family_code=spelled.change_family,
        response=spelled.expected_response_mode,
        change=dict(scenario["change"]),
        setup=tuple(map(dict, scenario.get("setup", ()))),
        trigger=trigger,
    )


def _source(category: str | None, suite: str) -> tuple[str, str]:
    if category is None:
        return SUITES[suite].benchmark, UNMODIFIED
    if category.startswith("LIBERO-PRO/"):
        return "pro", category.removeprefix("LIBERO-PRO/")
    return "plus", category
