"""Cases: the frozen benchmark units, and the manifests that hold them.

Pure data. The file format is that of the manifests released by the authors of LIBERO-MAX, so theirs load
here and ours load there; a manifest that is read and written again has the same bytes.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import sys
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pytest_libero_max.errors import ManifestError, did_you_mean

Json = dict[str, Any]
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

FAMILIES = ("geometry", "observation", "appearance_and_clutter", "path_constraint")


@dataclass(frozen=True)
class EventKind:
    """One of the eight events: what never differs between two of its cases.

    Attributes:
        family: The paper's family, by which results are grouped.
        code: The family code of the manifests.
        severity: Severity of variant 0 and variant 1.
        response: What a policy is expected to do: ``continue`` or ``replan``.
    """

    name: str
    family: str
    code: str
    severity: tuple[str, str]
    response: str


EVENTS: Mapping[str, EventKind] = {
    kind.name: kind
    for kind in (
        EventKind("illumination_switch", "appearance_and_clutter", "OBS", ("high", "high"), "continue"),
        EventKind("camera_shift", "observation", "OBS", ("high", "high"), "continue"),
        EventKind("visual_theme_switch", "appearance_and_clutter", "OBS", ("high", "high"), "continue"),
        EventKind("sensor_noise_onset", "observation", "OBS", ("high", "high"), "continue"),
        EventKind("target_relocation", "geometry", "GEO", ("medium", "high"), "replan"),
        EventKind("receptacle_relocation", "geometry", "GEO", ("medium", "high"), "replan"),
        EventKind("distractor_burst", "appearance_and_clutter", "CLUTTER", ("high", "high"), "continue"),
        EventKind("obstacle_insertion", "path_constraint", "OBSTACLE", ("high", "high"), "replan"),
    )
}
"""The eight events in the benchmark's order."""


@dataclass(frozen=True)
class Trigger:
    """When an event fires: the first step with the end effector within ``distance_m`` of ``entity``."""

    entity: str
    distance_m: float = TRIGGER_DISTANCE_M
    kind: Literal["on_proximity"] = "on_proximity"

    def to_dict(self) -> Json:
        return {"distance_m": self.distance_m, "type": self.kind, "value": self.entity}


@dataclass(frozen=True)
class Event:
    """A change in the middle of an episode.

    Attributes:
        name: One of :data:`EVENTS`.
        variant: Parameter variant, 0 or 1 (``draw_id`` in the manifests).
        seed: Scenario seed; whatever an event draws at run time is drawn from it.
        change: The change as the manifest spells it: an ``operation`` and its parameters.
        setup: Changes both arms share, applied right after reset.
        trigger: When the change happens.
    """

    name: str
    variant: int
    seed: int
    severity: str
    change: Json
    setup: tuple[Json, ...]
    trigger: Trigger

    @property
    def kind(self) -> EventKind:
        return EVENTS[self.name]

    @property
    def family(self) -> str:
        return self.kind.family


@dataclass(frozen=True)
class Case:
    """One frozen unit of the benchmark; the evaluation of a case is a pair of rollouts.

    Attributes:
        case_id: Unique in its manifest.
        suite: LIBERO suite, for example ``libero_spatial``.
        task_index: Index in the source's own registry (LIBERO-Plus: its long list; otherwise 0 to 9).
        init_state_index: Which frozen initial state.
        policy_seed: Seed of the policy, the same in both rollouts.
        event: The one change of the Dynamic rollout.
        source: ``plus``, ``pro``, or ``libero`` for an unmodified task.
        source_category: Category of the source variation; ``Unmodified`` for an unmodified task.
        difficulty: LIBERO-Plus difficulty 1 to 5, or None.
        instruction: Prompt fixed by the manifest, or None where the substrate's task gives it.
        record: The case exactly as its manifest spells it.
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
        """Name of the case's test item, for example ``libero-spatial-t00-i00-camera_shift-v1``."""
        category = "" if self.source == "libero" else f"-{_slug(self.source_category)}"
        suite = self.suite.removeprefix("libero_")
        width = 4 if self.source == "plus" else 2
        return (
            f"{self.source}{category}-{suite}-t{self.task_index:0{width}d}-i{self.init_state_index:02d}"
            f"-{self.event.name}-v{self.event.variant}"
        )


@dataclass(frozen=True)
class Manifest:
    """A frozen set of cases with the protocol under which they are played."""

    benchmark_id: str
    version: str
    protocol: Json
    cases: tuple[Case, ...]

    def __len__(self) -> int:
        return len(self.cases)

    def __iter__(self) -> Iterator[Case]:
        return iter(self.cases)

    @property
    def digest(self) -> str:
        """SHA-256 over the cases in manifest order, hexadecimal: the identity of the case set."""
        return canonical_digest([case.record for case in self.cases])

    def to_json(self) -> str:
        """The manifest's file content: sorted keys, two spaces, a final newline."""
        document = {
            "benchmark_id": self.benchmark_id,
            "benchmark_version": self.version,
            "protocol": self.protocol,
            "cases": [case.record for case in self.cases],
        }
        return json.dumps(document, indent=2, sort_keys=True) + "\n"


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no spaces; refuses NaN and infinities."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def canonical_digest(value: Any) -> str:
    """SHA-256 of :func:`canonical_json`, hexadecimal."""
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def read_content(path: Path) -> bytes:
    """The bytes of a file, unpacked where its name ends in ``.gz``.

    Raises:
        OSError: It cannot be read, or is damaged.
    """
    content = path.read_bytes()
    if path.suffix != ".gz":
        return content
    try:
        return gzip.decompress(content)
    except (EOFError, zlib.error) as error:
        raise OSError(f"{path}: {error}") from error


def load_manifest(path: Path) -> Manifest:
    """Read and check a manifest, ``.json`` or ``.json.gz``.

    Raises:
        ManifestError: The file is missing, is not JSON, or breaks the format; names the file and the case.
    """
    try:
        content = read_content(path)
    except OSError as error:
        raise _unreadable(path, error) from error
    return decode_manifest(content, path)


def decode_manifest(content: bytes, path: Path) -> Manifest:
    """Check the unpacked content of a manifest; see :func:`load_manifest`.

    Args:
        content: What was read.
        path: Where, for messages.

    Raises:
        ManifestError: It is not JSON, or breaks the format.
    """
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        raise _unreadable(path, error) from error
    try:
        document = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ManifestError(
            f"{path}: not a JSON document ({error}). The file is damaged or is not a manifest; restore it."
        ) from error
    try:
        return parse_manifest(document)
    except ManifestError as error:
        raise ManifestError(f"{path}: {error}") from error


def _unreadable(path: Path, error: Exception) -> ManifestError:
    return ManifestError(f"Cannot read manifest {str(path)!r}: {error}. Give the path of a JSON manifest.")


def parse_manifest(document: Any) -> Manifest:
    """Check a decoded manifest.

    Raises:
        ManifestError: It breaks the format or contradicts itself.
    """
    top = _object(document, "manifest")
    _keys(top, "manifest", {"benchmark_id", "benchmark_version", "protocol", "cases"})
    protocol = _object(top["protocol"], "protocol")
    if protocol.get("arms") != ["control", "intervention"]:
        raise ManifestError(
            f"protocol.arms={protocol.get('arms')!r}, but must be ['control', 'intervention']."
        )
    raw = top["cases"]
    if not isinstance(raw, list) or not raw:
        raise ManifestError("cases must be a non-empty list.")
    cases = tuple(parse_case(record, f"cases[{i}]") for i, record in enumerate(raw))
    for case_id, count in Counter(case.case_id for case in cases).items():
        if count > 1:
            raise ManifestError(f"case_id={case_id!r} occurs {count} times; ids must be unique.")
    for item_id, count in Counter(case.item_id for case in cases).items():
        if count > 1:
            raise ManifestError(
                f"{count} cases describe the same configuration {item_id!r}; keep one of them."
            )
    return Manifest(
        benchmark_id=_text(top, "benchmark_id", "manifest"),
        version=_text(top, "benchmark_version", "manifest"),
        protocol=dict(protocol),
        cases=cases,
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
        where: How to name it in an error.

    Raises:
        ManifestError: It breaks the format.
    """
    case = _object(record, where)
    _keys(case, where, _CASE_REQUIRED, _CASE_OPTIONAL)
    case_id = _text(case, "case_id", where)
    where = f"case {case_id!r}"
    suite = _text(case, "task_suite_name", where)
    if suite not in SUITE_BUDGETS:
        raise ManifestError(f"{where}: task_suite_name={suite!r}. {did_you_mean(suite, SUITE_BUDGETS)}")
    variant = case.get("substrate_variant")
    instruction = (
        None if variant is None else _text(_object(variant, where), "language", f"{where}: substrate_variant")
    )
    source, category = _source(case, where)
    difficulty = case.get("substrate_difficulty")
    if difficulty is not None and (type(difficulty) is not int or not 1 <= difficulty <= 5):
        raise ManifestError(f"{where}: substrate_difficulty={difficulty!r}, but must be null or 1 to 5.")
    return Case(
        case_id=case_id,
        suite=suite,
        task_index=_count(case, "task_index", where),
        init_state_index=_count(case, "init_state_index", where),
        policy_seed=_count(case, "policy_seed", where),
        event=_parse_event(case["scenario"], where),
        source=source,
        source_category=category,
        difficulty=difficulty,
        instruction=instruction,
        record=dict(case),
    )


def _parse_event(value: Any, where: str) -> Event:
    scenario = _object(value, f"{where}: scenario")
    where = f"{where}: scenario"
    _keys(scenario, where, _SCENARIO_REQUIRED, _SCENARIO_OPTIONAL)
    name = _text(scenario, "change_type", where)
    if name not in EVENTS:
        raise ManifestError(f"{where}.change_type={name!r} is not an event. {did_you_mean(name, EVENTS)}")
    randomization = _object(scenario.get("randomization", {"draw_id": 0}), f"{where}.randomization")
    draw = randomization.get("draw_id")
    if type(draw) is not int or draw not in (0, 1):
        raise ManifestError(f"{where}.randomization.draw_id={draw!r}, but an event has the variants 0 and 1.")
    kind = EVENTS[name]
    if scenario["change_family"] != kind.code:
        raise ManifestError(
            f"{where}.change_family={scenario['change_family']!r}, but {name} belongs to {kind.code!r}."
        )
    setup = scenario.get("setup", [])
    if not isinstance(setup, list):
        raise ManifestError(f"{where}.setup must be a list of changes.")
    return Event(
        name=name,
        variant=draw,
        seed=_count(scenario, "seed", where),
        severity=_text(scenario, "severity", where),
        change=_change(scenario["change"], f"{where}.change"),
        setup=tuple(_change(item, f"{where}.setup[{i}]") for i, item in enumerate(setup)),
        trigger=_parse_trigger(scenario["trigger"], f"{where}.trigger"),
    )


def _parse_trigger(value: Any, where: str) -> Trigger:
    trigger = _object(value, where)
    _keys(trigger, where, {"type", "value"}, {"distance_m"})
    if trigger["type"] != "on_proximity":
        raise ManifestError(
            f"{where}.type={trigger['type']!r}; every event of the benchmark fires 'on_proximity'."
        )
    distance = trigger.get("distance_m")
    longest = sys.float_info.max
    if isinstance(distance, bool) or not isinstance(distance, int | float) or not 0 < distance <= longest:
        raise ManifestError(f"{where}.distance_m={distance!r}, but must be a length in metres above 0.")
    return Trigger(entity=_text(trigger, "value", where), distance_m=float(distance))


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
    change = _object(value, where)
    _text(change, "operation", where)
    return dict(change)


def _object(value: Any, where: str) -> Json:
    if not isinstance(value, dict):
        raise ManifestError(f"{where} must be a JSON object, not {type(value).__name__}.")
    return value


def _keys(value: Json, where: str, required: set[str], optional: Sequence[str] | set[str] = ()) -> None:
    missing = sorted(required - value.keys())
    if missing:
        raise ManifestError(f"{where} lacks {', '.join(missing)}.")
    known = required | set(optional)
    for key in value:
        if key not in known:
            raise ManifestError(f"{where} has the unknown field {key!r}. {did_you_mean(key, known)}")


def _text(value: Json, key: str, where: str) -> str:
    text = value.get(key)
    if not isinstance(text, str) or not text:
        raise ManifestError(f"{where}.{key}={text!r}, but must be a non-empty string.")
    return text


def _count(value: Json, key: str, where: str) -> int:
    number = value.get(key)
    if isinstance(number, bool) or not isinstance(number, int) or number < 0:
        raise ManifestError(f"{where}.{key}={number!r}, but must be an integer of at least 0.")
    return number


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _slug(text: str) -> str:
    return text.lower().replace(" ", "_")
