"""The parameters of the eight events, two variants each, for a given task.

The numbers and the order of every random draw are those of the released benchmark, so its scenarios are
reproduced field by field.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from pytest_libero_max.benchmark.cases import EVENTS, Event, Trigger
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.errors import ManifestError, did_you_mean
from pytest_libero_max.events.eligibility import DISTRACTOR_COUNT, eligible, eligible_events
from pytest_libero_max.sources.metadata import TaskMetadata

_DIAGONAL = 1.0 / math.sqrt(2.0)
DIRECTIONS = (
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (_DIAGONAL, _DIAGONAL),
    (-_DIAGONAL, _DIAGONAL),
    (_DIAGONAL, -_DIAGONAL),
    (-_DIAGONAL, -_DIAGONAL),
)
"""Unit vectors in the table plane along which a relocation may go, world frame."""

_DECIMALS = 8
_LIGHT_SCALE = (0.20, 1.80)
_CAMERA = (([0.06, 0.0, 0.02], 18.0, 12.0), ([-0.06, 0.03, 0.0], -22.0, -12.0))
_THEME = (([2, 0, 1], [0.70, 1.15, 1.30]), ([1, 2, 0], [1.25, 0.70, 1.10]))
_CORRUPTION = ((24.0, 0.08), (36.0, 0.16))
_RELOCATION_M = (0.06, 0.12)
_BURST_RADIUS_M = (0.09, 0.17)
_OBSTACLE_OFFSET_M = ([0.14, 0.0, 0.0], [0.0, -0.14, 0.0])
_CALIBRATION = "deterministic_candidate_requires_preflight"


def resolve_event(name: str, variant: int, task: TaskMetadata, identity: Identity) -> Event:
    """Fix every parameter of an event for a task.

    Args:
        name: One of :data:`pytest_libero_max.benchmark.cases.EVENTS`.
        variant: 0 or 1.
        task: What the scene contains.
        identity: Which configuration this is; the source of all seeds.

    Raises:
        ManifestError: No such event or variant, or the task cannot host it.
    """
    if name not in EVENTS:
        raise ManifestError(f"event={name!r} is not an event. {did_you_mean(name, EVENTS)}")
    if variant not in (0, 1):
        raise ManifestError(f"variant={variant!r}, but an event has the variants 0 and 1.")
    trigger = task.trigger_entity
    if trigger is None or not eligible(name, task):
        raise ManifestError(
            f"event={name!r} is not possible in {task.name!r}, which lacks what it needs. "
            f"Possible: {', '.join(eligible_events(task)) or 'none'}."
        )
    change, removed = _RESOLVERS[name](variant, task, identity, trigger)
    setup = tuple(_removal(entity, i) for i, entity in enumerate(removed))
    return Event(
        name=name,
        variant=variant,
        seed=identity.seed(name, variant),
        severity=EVENTS[name].severity[variant],
        change=change,
        setup=setup,
        trigger=Trigger(trigger),
    )


Resolved = tuple[Json, list[str]]
"""A change, and the objects that its setup takes out of the scene."""


def _lighting(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    return {"operation": "set_lighting", "scale": _LIGHT_SCALE[variant]}, []


def _camera(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    delta, yaw, fovy = _CAMERA[variant]
    return {
        "operation": "shift_camera",
        "camera": "agentview",
        "delta_position_m": list(delta),
        "yaw_degrees": yaw,
        "delta_fovy_degrees": fovy,
        "calibration": "fixed_global_viewpoint",
    }, []


def _theme(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    permutation, multiplier = _THEME[variant]
    return {
        "operation": "set_visual_theme",
        "rgb_permutation": list(permutation),
        "rgb_multiplier": list(multiplier),
    }, []


def _corruption(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    noise, occlusion = _CORRUPTION[variant]
    return {
        "operation": "set_sensor_corruption",
        "noise_std": noise,
        "occlusion_fraction": occlusion,
        "seed": identity.seed("sensor_noise_onset", variant),
    }, []


def _target(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    return _relocation("target_relocation", task.primary_target, variant, task, identity), []


def _receptacle(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    return _relocation("receptacle_relocation", task.primary_receptacle, variant, task, identity), []


def _relocation(event: str, moved: str | None, variant: int, task: TaskMetadata, identity: Identity) -> Json:
    assert moved is not None  # eligibility demands it
    x, y = DIRECTIONS[identity.direction_index(event)]
    distance = _RELOCATION_M[variant]
    return {
        "operation": "move_object",
        "object": moved,
        "delta_position_m": [round(x * distance, _DECIMALS), round(y * distance, _DECIMALS), 0.0],
        "direction_xy": [round(x, _DECIMALS), round(y, _DECIMALS)],
        "distance_m": distance,
        "support_entity": task.support(moved),
        "calibration": _CALIBRATION,
    }


def _burst(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    draw = random.Random(identity.seed("distractor_burst", variant))
    candidates = list(task.supported_distractors)
    draw.shuffle(candidates)
    chosen = candidates[:DISTRACTOR_COUNT]
    phase = draw.uniform(0.0, 2.0 * math.pi)
    placements = []
    for i, name in enumerate(chosen):
        angle = phase + i * 2.0 * math.pi / DISTRACTOR_COUNT
        radius = draw.uniform(*_BURST_RADIUS_M)
        offset = [radius * math.cos(angle), radius * math.sin(angle), 0.0]
        placements.append(_placement(name, trigger, [round(v, _DECIMALS) for v in offset], task))
    return {
        "operation": "insert_distractors",
        "distractor_count": DISTRACTOR_COUNT,
        "placements": placements,
    }, chosen


def _obstacle(variant: int, task: TaskMetadata, identity: Identity, trigger: str) -> Resolved:
    candidates = task.obstacle_candidates
    chosen = candidates[variant % len(candidates)]
    return {
        "operation": "insert_obstacle",
        **_placement(chosen, trigger, list(_OBSTACLE_OFFSET_M[variant]), task),
        "placement_rule": "target_support_approach_ring",
    }, [chosen]


def _placement(entity: str, anchor: str, offset_m: list[float], task: TaskMetadata) -> Json:
    return {
        "object": entity,
        "relative_to": anchor,
        "offset_m": offset_m,
        "preserve_initial_z": True,
        "support_entity": task.support(entity),
    }


def _removal(entity: str, index: int) -> Json:
    return {
        "operation": "remove_object",
        "object": entity,
        "offworld_position_m": [-2.0 - 0.2 * index, 0.0, -5.0],
    }


_RESOLVERS: dict[str, Callable[[int, TaskMetadata, Identity, str], Resolved]] = {
    "illumination_switch": _lighting,
    "camera_shift": _camera,
    "visual_theme_switch": _theme,
    "sensor_noise_onset": _corruption,
    "target_relocation": _target,
    "receptacle_relocation": _receptacle,
    "distractor_burst": _burst,
    "obstacle_insertion": _obstacle,
}
