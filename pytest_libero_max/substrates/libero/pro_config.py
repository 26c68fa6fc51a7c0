"""Changes that LIBERO-PRO makes: read from its task files, or as published where they are missing.

Its task files are LIBERO's with a block ``(:perturbation_config ...)`` of sections, of which those that are
switched on say what the runtime does once the initial state has been set. The values are the same for every
task of a category; only what they are applied to follows from the task.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.tasks.contents import owner

if TYPE_CHECKING:
    from pytest_libero_max.substrates.libero.world import LiberoWorld

Section = Mapping[str, tuple[Any, ...]]
"""The fields of a section; a field's words and numbers one after the other, without its inner brackets."""

Config = Mapping[str, Section]
"""The sections that are switched on."""

SECTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "semantic": (),
        "object": (),
        "position": (),
        "task": (),
        "visual_noise_glare": ("lighting", "observation"),
        "camera_view_angle": ("camera",),
        "object_texture": ("object_appearance",),
        "view_occlusion": ("object_placement",),
        "object_shape": ("object_shape",),
        "initial_pose_position_angle": ("initial_pose",),
    }
)
"""LIBERO-PRO's categories, in its order, and the sections that each of them is made of."""

_BLOCK = ":perturbation_config"
_OFF = ("none", "default", "identity", "disabled", "off")
_ONLY_MODE = MappingProxyType(
    {"lighting": "dark_lighting", "observation": "dark_noise", "camera": "agentview_angle"}
)
_FIELDS = MappingProxyType(
    {
        "lighting": ("ambient", "diffuse", "specular"),
        "observation": ("brightness", "sigma"),
        "camera": ("name", "pos", "quat"),
        "object_appearance": ("targets", "rgba"),
        "object_placement": (
            "reference",
            "front_direction",
            "targets",
            "offsets_xy",
            "target_quat",
            "z_offset",
            "min_reference_distance",
        ),
        "object_shape": (),
        "initial_pose": ("target", "delta_xy", "min_delta_norm", "yaw"),
    }
)

_TINTS = MappingProxyType(
    {
        "main_table": (0.72, 0.63, 0.50, 1.0),
        "kitchen_table": (0.72, 0.63, 0.50, 1.0),
        "floor": (0.35, 0.34, 0.32, 1.0),
        "living_room_table": (0.30, 0.20, 0.12, 1.0),
        "study_table": (0.50, 0.36, 0.20, 1.0),
    }
)
"""Colour of the tint by the surface of the scene, rgba."""

_BESIDE = frozenset({("libero_goal", index) for index in (0, 1, 3, 4, 7)})
"""Tasks whose occluder stands obliquely in front of the target, next to a large fixture."""


def check_category(category: str) -> None:
    """Refuse a category that LIBERO-PRO does not have with SubstrateError."""
    if category not in SECTIONS:
        raise SubstrateError(
            f"LIBERO-PRO has no category {category!r} for pairs. {did_you_mean(category, SECTIONS)}"
        )


def read_config(path: Path, category: str) -> Config:
    """Sections that a task file of LIBERO-PRO switches on, or raise SubstrateError."""
    try:
        sections = _sections(path)
    except Exception as error:  # the package's parser raises whatever it likes
        raise SubstrateError(f"Cannot read the task {str(path)!r}: {error}.") from error
    config = {name: section for name, section in sections.items() if _switched_on(section)}
    for name in SECTIONS[category]:
        wrong = _wrong(name, config.get(name))
        if wrong:
            raise SubstrateError(
                f"{str(path)!r} does not say what LIBERO-PRO's {category!r} does: {wrong}. Restore the file "
                "from the data set zhouxueyang/LIBERO-Pro."
            )
    return {name: config[name] for name in SECTIONS[category]}


def _sections(path: Path) -> dict[str, Section]:
    """Every section of a task file's block; none where it has no block."""
    groups = importlib.import_module("bddl.parsing").scan_tokens(filename=str(path))
    blocks = [group[1:] for group in groups if group[:1] == [_BLOCK]]
    return {
        name.lstrip(":"): {key.lstrip(":"): _flat(values) for key, *values in fields}
        for block in blocks
        for name, *fields in block
        if all(type(field) is list for field in fields)
    }


def _wrong(name: str, section: Section | None) -> str | None:
    if section is None:
        return f"{name} is missing or switched off"
    lacking = [field for field in _FIELDS[name] if field not in section]
    if lacking:
        return f"{name} lacks {', '.join(lacking)}"
    if name in _ONLY_MODE and section.get("mode") != (_ONLY_MODE[name],):
        return f"{name} is not of the mode {_ONLY_MODE[name]!r}"
    return None


def _switched_on(section: Section) -> bool:
    return section.get("enabled", ("true",))[0] != "false" and section.get("mode", ("",))[0] not in _OFF


def _flat(values: Any) -> tuple[Any, ...]:
    flat: list[Any] = []
    for value in values:
        flat += _flat(value) if type(value) is list else [_atom(value)]
    return tuple(flat)


def _atom(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


def published_config(category: str, suite: str, index: int, world: LiberoWorld) -> Config:
    """Return the values of LIBERO-PRO's own task file, for a scene that is built without it.

    Args:
        category: One of those that change LIBERO's own scene.
        index: Of the task in it.
    """
    if category == "visual_noise_glare":
        return {
            "lighting": {"ambient": (0.020,), "diffuse": (0.16,), "specular": (0.010,)},
            "observation": {"brightness": (0.68,), "sigma": (12.0,)},
        }
    if category == "camera_view_angle":
        pose = {"pos": (0.48, 0.24, 1.62), "quat": (0.6099232, 0.3594558, 0.3594558, 0.6099232)}
        return {"camera": {"name": ("agentview",), **pose}}
    if category == "object_texture":
        surface = next(entity.name for entity in world.entities.values() if entity.kind == "surface")
        return {"object_appearance": {"targets": tinted(world), "rgba": _TINTS[surface]}}
    if category == "object_shape":
        return {"object_shape": {}}  # the runtime's way of resizing has no effect
    if category == "initial_pose_position_angle":
        where = {"delta_xy": (0.17, -0.06), "min_delta_norm": (0.18,), "yaw": (math.pi / 4,)}
        return {"initial_pose": {"target": (interests(world)[0],), **where}}
    if category == "view_occlusion":
        return {"object_placement": _in_front(world, beside=(suite, index) in _BESIDE)}
    return {}


def _in_front(world: LiberoWorld, beside: bool) -> Section:
    target, *others = interests(world)
    section: dict[str, tuple[Any, ...]] = {
        "reference": (target,),
        "front_direction": (1.0, 0.0),
        "targets": (occluder(world.entities)[0],),
        "offsets_xy": (0.080, 0.090 if beside else 0.0),
        "target_quat": (1.0, 0.0, 0.0, 0.0),
        "z_offset": (0.0,),
        "min_reference_distance": (0.02,),
        "avoid_targets": tuple(others[:1]),
        "min_avoid_distance": (0.08,),
    }
    if target == "akita_black_bowl_1" and others[:1] == ["plate_1"]:
        between = {
            "between_object": ("plate_1",),
            "min_between_distance": (0.24,),
            "between_delta_xy": (0.16, 0.0),
        }
        section |= between
    elif target == "wine_bottle_1":
        section |= {
            "between_object": ("akita_black_bowl_1",),
            "min_between_distance": (0.18,),
            "between_delta_xy": (-0.18, 0.10),
        }
    return section


def occluder(names: Container[str]) -> tuple[str, str]:
    """Name and category of the object that LIBERO-PRO adds to a scene to hide the target."""
    if "study_table" in names:
        return "yellow_book_1", "yellow_book"  # there the target is a black book
    return "black_book_occluder_1", "black_book"


def interests(world: LiberoWorld) -> list[str]:
    """Entities that the task declares to be about, without the work surface."""
    return _no_surface(world, (owner(name, world.entities) for name in world.problem["obj_of_interest"]))


def tinted(world: LiberoWorld) -> tuple[str, ...]:
    """Return the goal's destinations but for the work surface; without any, the goal's subjects."""
    destinations: list[str | None] = []
    subjects: list[str | None] = []
    for predicate, *arguments in world.problem["goal_state"]:
        owners = [owner(argument, world.entities) for argument in arguments]
        subjects.append(owners[0])
        destinations += owners[1:] if predicate in ("on", "in") else owners
    return tuple(_no_surface(world, destinations) or dict.fromkeys(name for name in subjects if name))


def _no_surface(world: LiberoWorld, names: Iterable[str | None]) -> list[str]:
    return list(dict.fromkeys(name for name in names if name and world.entities[name].kind != "surface"))
