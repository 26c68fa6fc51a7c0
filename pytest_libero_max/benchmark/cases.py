"""Cases: the frozen benchmark units. Pure data, in the format of the manifests of LIBERO-MAX's authors.

A case of the authors is one event at one trigger; a ``program`` says more (:mod:`.programs`).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from pytest_libero_max.benchmark.documents import (
    Json,
    canonical_digest,
    require_count,
    require_keys,
    require_object,
    require_text,
    require_texts,
    require_word,
    slug,
)
from pytest_libero_max.benchmark.programs import Program, parse_program
from pytest_libero_max.errors import ManifestError, did_you_mean

Source = Literal["libero", "plus", "pro"]

SUITE_BUDGETS: Mapping[str, int] = {
    "libero_spatial": 220,
    "libero_object": 280,
    "libero_goal": 300,
    "libero_10": 520,
}
"""Policy steps an episode may take after the settle steps (1 step = 50 ms)."""

SETTLE_STEPS = 10
"""Control steps with the no-op action before the first query."""

TRIGGER_DISTANCE_M = 0.18


PROXIMITY = "on_proximity"
"""Type of the trigger of every case of the authors."""


@dataclass(frozen=True)
class Event:
    """A change in the middle of an episode.

    Attributes:
        name: Name of the event, for example ``camera_shift`` (``change_type`` in the manifests); see
            :mod:`pytest_libero_max.events.registry`.
        variant: Parameter variant, 0 or 1 (``draw_id`` in the manifests).
        seed: Scenario seed; whatever an event draws at run time is drawn from it.
        severity: ``low``, ``medium`` or ``high``.
        family_code: The manifests' code of the event's family, for example ``OBS`` (``change_family``).
        response: Expected response of a policy, ``continue`` or ``replan`` (``expected_response_mode``).
        change: The change as the manifest spells it: an ``operation`` and its parameters.
        setup: Changes both arms share, applied right after reset.
        trigger: Moment of the change, as the manifest spells it: a ``type`` and its parameters, among them
            the name of an entity in ``value``.
    """

    name: str
    variant: int
    seed: int
    severity: str
    family_code: str
    response: str
    change: Json
    setup: tuple[Json, ...]
    trigger: Json

    @property
    def entity(self) -> str:
        """The entity that the trigger names; distances and contacts of every arm are about it."""
        return str(self.trigger["value"])


@dataclass(frozen=True)
class Case:
    """One frozen unit of the benchmark; the evaluation of a case is a pair of rollouts.

    Attributes:
        case_id: Unique in its manifest.
        suite: LIBERO suite, for example ``libero_spatial``.
        task_index: Index in the source's own registry (LIBERO-Plus: its long list; otherwise 0 to 9).
        init_state_index: Index of the frozen initial state.
        policy_seed: Seed of the policy, the same in both rollouts.
        event: The one change of the Dynamic rollout.
        source: ``plus``, ``pro``, or ``libero`` for an unmodified task.
        source_category: Category of the source variation; ``Unmodified`` for an unmodified task.
        difficulty: LIBERO-Plus difficulty 1 to 5, or None.
        instruction: Prompt fixed by the manifest, or None where the substrate's task gives it.
        record: The case exactly as its manifest spells it.
        program: The arms of the case, where its manifest spells them out. None: nothing happens in Base, the
            event in Dynamic.
    """

    case_id: str
    suite: str
    task_index: int
    init_state_index: int
    policy_seed: int
    event: Event
    source: Source
    source_category: str
    difficulty: int | None
    instruction: str | None
    record: Json
    program: Program | None = None

    def __hash__(self) -> int:
        return hash(self.case_id)

    @property
    def budget(self) -> int:
        """Policy steps after the settle steps."""
        return SUITE_BUDGETS[self.suite]

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON of the case, hexadecimal."""
        return canonical_digest(self.record)

    @property
    def item_id(self) -> str:
        """Name of the case's test item, for example ``libero-spatial-t00-i00-camera_shift-v1``.

        It ends with the name of the case's program where it has one.
        """
        category = "" if self.source == "libero" else f"-{slug(self.source_category)}"
        suite = self.suite.removeprefix("libero_")
        width = 4 if self.source == "plus" else 2
        return (
            f"{self.source}{category}-{suite}-t{self.task_index:0{width}d}-i{self.init_state_index:02d}"
            f"-{self.event.name}-v{self.event.variant}"
            + ("" if self.program is None else f"-{self.program.name}")
        )

    @property
    def needs_format_2(self) -> bool:
        """True if the authors' format cannot express the case."""
        return self.program is not None or self.event.trigger["type"] != PROXIMITY

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


TIMING_BUCKETS = ("early", "middle", "late")
SEVERITIES = ("low", "medium", "high")
RESPONSES = ("continue", "replan")
"""Expected responses of a policy in a case that is scored by whether its task is completed."""

_VARIANT_OPTIONAL = (
    "benchmark",
    "category",
    "bddl_file",
    "init_states_file",
    "init_reference_bddl_file",
    "source_revision",
)

_CASE_REQUIRED = {
    "case_id",
    "task_suite_name",
    "task_index",
    "init_state_index",
    "policy_seed",
    "timing_bucket",
    "scenario",
}
_CASE_OPTIONAL = {
    "task_name",
    "substrate_category",
    "substrate_difficulty",
    "substrate_variant",
    "dynamic_phase",
    "program",
}
_SCENARIO_REQUIRED = {
    "scenario_id",
    "base_task_id",
    "seed",
    "change_family",
    "change_type",
    "severity",
    "trigger",
    "change",
    "expected_response_mode",
    "safety_constraints",
}
_SCENARIO_OPTIONAL = {"setup", "randomization"}


def parse_case(record: Any, where: str = "case") -> Case:
    """Check one case of a manifest.

    Args:
        record: The decoded JSON object.
        where: Name of it in an error.

    Raises:
        ManifestError: It breaks the format.
    """
    case = require_object(record, where)
    require_keys(case, where, _CASE_REQUIRED, _CASE_OPTIONAL)
    case_id = require_text(case, "case_id", where)
    where = f"case {case_id!r}"
    suite = require_text(case, "task_suite_name", where)
    if suite not in SUITE_BUDGETS:
        raise ManifestError(f"{where}: task_suite_name={suite!r}. {did_you_mean(suite, SUITE_BUDGETS)}")
    require_word(case, "timing_bucket", where, TIMING_BUCKETS)
    for key in ("task_name", "dynamic_phase"):
        if key in case:
            require_text(case, key, where)
    source, category = _source(case, where)
    difficulty = case.get("substrate_difficulty")
    if difficulty is not None and (type(difficulty) is not int or not 1 <= difficulty <= 5):
        raise ManifestError(f"{where}: substrate_difficulty={difficulty!r}, but must be null or 1 to 5.")
    return Case(
        case_id=case_id,
        suite=suite,
        task_index=require_count(case, "task_index", where),
        init_state_index=require_count(case, "init_state_index", where),
        policy_seed=require_count(case, "policy_seed", where),
        event=_parse_event(case["scenario"], where),
        source=source,
        source_category=category,
        difficulty=difficulty,
        instruction=_instruction(case, where),
        record=dict(case),
        program=parse_program(case["program"], f"{where}: program") if "program" in case else None,
    )


def _instruction(case: Json, where: str) -> str | None:
    """Return the prompt of a case's ``substrate_variant``; None where it has none."""
    if case.get("substrate_variant") is None:
        return None
    where = f"{where}: substrate_variant"
    variant = require_object(case["substrate_variant"], where)
    require_keys(variant, where, {"language"}, _VARIANT_OPTIONAL)
    for key in variant:
        require_text(variant, key, where)
    return require_text(variant, "language", where)


def _parse_event(value: Any, where: str) -> Event:
    scenario = require_object(value, f"{where}: scenario")
    where = f"{where}: scenario"
    require_keys(scenario, where, _SCENARIO_REQUIRED, _SCENARIO_OPTIONAL)
    name = require_text(scenario, "change_type", where)
    for key in ("scenario_id", "base_task_id"):
        require_text(scenario, key, where)
    require_texts(scenario, "safety_constraints", where)
    draw = _draw(scenario["randomization"], f"{where}.randomization") if "randomization" in scenario else 0
    setup = scenario.get("setup", [])
    if not isinstance(setup, list):
        raise ManifestError(f"{where}.setup must be a list of changes.")
    return Event(
        name=name,
        variant=draw,
        seed=require_count(scenario, "seed", where),
        severity=require_word(scenario, "severity", where, SEVERITIES),
        family_code=require_text(scenario, "change_family", where),
        response=require_word(scenario, "expected_response_mode", where, RESPONSES),
        change=_change(scenario["change"], f"{where}.change"),
        setup=tuple(_change(item, f"{where}.setup[{i}]") for i, item in enumerate(setup)),
        trigger=_parse_trigger(scenario["trigger"], f"{where}.trigger"),
    )


def _draw(value: Any, where: str) -> int:
    """Return the parameter variant that a scenario's ``randomization`` names."""
    randomization = require_object(value, where)
    require_keys(randomization, where, {"sampler", "draw_id", "seed"})
    require_text(randomization, "sampler", where)
    require_count(randomization, "seed", where)
    draw = randomization["draw_id"]
    if type(draw) is not int or draw not in (0, 1):
        raise ManifestError.seen(f"{where}.draw_id", draw, ", but an event has the variants 0 and 1.")
    return draw


def _parse_trigger(value: Any, where: str) -> Json:
    """Return a trigger that names an entity; of types beside ``on_proximity`` only the form is checked."""
    trigger = require_object(value, where)
    require_text(trigger, "value", where)
    if require_text(trigger, "type", where) != PROXIMITY:
        return dict(trigger)
    require_keys(trigger, where, {"type", "value"}, {"distance_m"})
    distance = trigger.get("distance_m")
    longest = sys.float_info.max
    if isinstance(distance, bool) or not isinstance(distance, int | float) or not 0 < distance <= longest:
        raise ManifestError.seen(f"{where}.distance_m", distance, ", but must be a length in metres above 0.")
    return {**trigger, "distance_m": float(distance)}


def _source(case: Json, where: str) -> tuple[Source, str]:
    category = case.get("substrate_category")
    if category is None:
        return "libero", "Unmodified"
    if not isinstance(category, str) or not category:
        raise ManifestError(f"{where}: substrate_category={category!r}, but must be a non-empty string.")
    if category.startswith("LIBERO-PRO/"):
        return "pro", category.removeprefix("LIBERO-PRO/")
    return "plus", category


def _change(value: Any, where: str) -> Json:
    change = require_object(value, where)
    require_text(change, "operation", where)
    return dict(change)
