"""The catalogue of LIBERO-PRO: ten categories, one variation of each of the forty tasks, ten initial states.

Recast objects, exchanged places and other tasks are LIBERO-PRO's own. Where its variation would do nothing,
or leave nothing to do, another is chosen, and the entry says so. A parameter that LIBERO-PRO does not give
has a note that says why. The initial states are those of the unmodified task.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from pytest_libero_max.benchmark.documents import Json, read_text
from pytest_libero_max.changes.camera import PlaceCamera
from pytest_libero_max.changes.instruction import SetInstruction, SetTask
from pytest_libero_max.changes.light import SetLamps, SetLighting
from pytest_libero_max.changes.material import CoverEntity
from pytest_libero_max.changes.pixels import SetGlare, SetSensorCorruption
from pytest_libero_max.changes.poses import PutObject
from pytest_libero_max.substrates.embedded.arenas import ARENAS
from pytest_libero_max.substrates.embedded.catalogue import swaps, wording
from pytest_libero_max.substrates.embedded.catalogue.floorplan import floorplan
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.objects.restyled import SMALL, style_of
from pytest_libero_max.substrates.embedded.surfaces import shown
from pytest_libero_max.substrates.variation import Variation, seed
from pytest_libero_max.tasks.libero_tasks import SUITES, Task, category_of
from pytest_libero_max.tasks.libero_tasks import task as task_of
from pytest_libero_max.tasks.sources import PRO_CATEGORIES
from pytest_libero_max.worlds.contract import Goal

CAMERA = "agentview"


class _Row(NamedTuple):
    """Parameters of LIBERO-PRO's variations of one task."""

    recast: Mapping[str, str]
    """New category by category, object by object."""
    places: Mapping[str, str]
    """Instance by the instance whose place it takes."""
    words: str
    """Instruction of the other task."""
    goal: Goal
    """Its goal."""
    target: str
    """Instance that is occluded, resized or started elsewhere."""
    covered: tuple[str, ...]
    """Instances that are covered with another material."""


def _read(table: Mapping[str, Any]) -> _Row:
    places = MappingProxyType({key: other for a, b in table["exchange"] for key, other in ((a, b), (b, a))})
    goal = tuple(tuple(fact) for fact in table["goal"])
    recast = MappingProxyType(table["recast"])
    return _Row(recast, places, table["words"], goal, table["target"], tuple(table["covered"]))


_ROWS = MappingProxyType(
    {
        suite: tuple(map(_read, rows))
        for suite, rows in tomllib.loads(read_text(Path(__file__).with_name("pro_tasks.toml"))).items()
    }
)

_VIEW_POSITION = (0.48, 0.24, 0.72)
_VIEW_AIM = (-0.05, 0.02, 0.02)
"""LIBERO-PRO's camera position above the table's top, in every room above its own surface; it is aimed at the
middle of the workspace, which LIBERO-PRO's own orientation leaves out of the picture."""

_COVER = MappingProxyType(
    {
        "tabletop": "wood_oak",
        "kitchen": "wood_ash",
        "living_room": "wood_ebony",
        "study": "wood_cherry",
        "floor": "concrete",
    }
)
"""Surface that looks like the work surface, by room."""

_RESHAPED = MappingProxyType({("libero_spatial", 5): "bigger_akita_black_bowl"})
"""Exceptions, for which the small relative will not do: a small bowl sinks into the ramekin up to its rim."""

ANOTHER_GOAL: Mapping[tuple[str, str, int], str] = MappingProxyType(
    {
        ("task", "libero_goal", 7): "to turn the stove off, which it is from the start",
    }
)
"""Goals of LIBERO-PRO that differ from those of the variations here, by category, suite and task."""

_LEVELS = (0.020, 0.16, 0.010)
_BRIGHTNESS, _NOISE_STD = 0.68, 12.0
_GLARE = SetGlare(0.85, 0.72, 0.74, 0.30)
"""LIBERO-PRO announces glare and has none; this one leaves the middle of the picture readable."""


def _row(task: Task) -> _Row:
    return _ROWS[task.suite][task.index]


Parts = tuple[str, Json, tuple[Json, ...]]
"""Kind, scene and changes."""


def _semantic(task: Task) -> Parts:
    words = wording.paraphrase(task.language)
    return "paraphrase", {}, (SetInstruction(words, "synonyms").to_dict(),)


def _object(task: Task) -> Parts:
    recast, changes = [], []
    plan = floorplan(task.suite, task.index)
    for name in (*task.objects, *task.fixtures):
        kind = category_of(name)
        if kind in _row(task).recast:
            new = _row(task).recast[kind]
            instance = new + name[len(kind) :]
            recast.append([name, instance, new])
            style = style_of(new)
            if name in task.objects and (style is None or style.scale != (1.0, 1.0, 1.0)):
                changes.append(_settled(plan.carried.get(name, plan.arena.surface), instance))
    return "recast", {"recast": recast}, tuple(changes)


def _settled(onto: str, name: str) -> Json:
    """Put an object of another size down where it is, since it rests at another height."""
    return PutObject(name, onto, (0.0, 0.0), name).to_dict()


def _position(task: Task) -> Parts:
    return "exchange", {}, swaps.exchanged(task, _row(task).places)


def _task(task: Task) -> Parts:
    row = _row(task)
    return "other task", {}, (SetTask(row.words, row.goal).to_dict(),)


def _glare(task: Task) -> Parts:
    changes = (
        SetLamps(levels=_LEVELS),
        SetLighting(1.0, _BRIGHTNESS),
        _GLARE,
        SetSensorCorruption(_NOISE_STD, 0.0, seed("pro", task.name, "noise")),
    )
    return "dark, glare, noise", {}, tuple(change.to_dict() for change in changes)


def _view(task: Task) -> Parts:
    arena = ARENAS[task.arena]
    x, y, z = _VIEW_POSITION
    position = (x, y, round(arena.top_z + z, 6))
    aim = (_VIEW_AIM[0], _VIEW_AIM[1], round(arena.top_z + _VIEW_AIM[2], 6))
    return "placed", {}, (PlaceCamera.looking_at(CAMERA, position, aim).to_dict(),)


def _texture(task: Task) -> Parts:
    surface = _COVER[task.arena]
    covers = (CoverEntity(name, (1.0, 1.0, 1.0), shown(surface)).to_dict() for name in _row(task).covered)
    return "covered", {"surfaces": [surface]}, tuple(covers)


def _occlusion(task: Task) -> Parts:
    scene = {"extras": [[swaps.OCCLUDER, swaps.OCCLUDER_CATEGORY]]}
    return "occluder", scene, swaps.occluded(task, _row(task).target)


def _shape(task: Task) -> Parts:
    name = _row(task).target
    plan = floorplan(task.suite, task.index)
    kind = _RESHAPED.get((task.suite, task.index), SMALL + category_of(name))
    changes: tuple[Json, ...] = ()
    if not category(category_of(name)).fixture:
        changes = (_settled(plan.carried.get(name, plan.arena.surface), name),)
    return "resized", {"recast": [[name, name, kind]]}, changes


def _pose(task: Task) -> Parts:
    return "elsewhere", {}, swaps.started_elsewhere(task, _row(task).target)


_MAKERS: Mapping[str, Callable[[Task], Parts]] = MappingProxyType(
    {
        "semantic": _semantic,
        "object": _object,
        "position": _position,
        "task": _task,
        "visual_noise_glare": _glare,
        "camera_view_angle": _view,
        "object_texture": _texture,
        "view_occlusion": _occlusion,
        "object_shape": _shape,
        "initial_pose_position_angle": _pose,
    }
)


@cache
def pro_suite(category: str, suite: str) -> tuple[Variation, ...]:
    """Return the ten variations of a category and a suite, in the order of its tasks.

    Raises:
        SubstrateError: The suite does not exist.
    """
    variations = []
    for index in range(10):
        task = task_of(suite, index)
        kind, scene, changes = _MAKERS[category](task)
        variations.append(
            Variation("pro", suite, index, index, task.name, category, kind, None, scene, changes)
        )
    return tuple(variations)


def pro_variations() -> tuple[Variation, ...]:
    """All 400, by category, suite and task."""
    return tuple(
        variation
        for category in PRO_CATEGORIES
        for suite in SUITES
        for variation in pro_suite(category, suite)
    )
