"""Compile a task's scene with added or replaced objects and surfaces, for source variations.

Objects are added, which wait out of the scene until a change puts them somewhere; objects and fixtures are
replaced by their relatives; textures are loaded that surfaces can be covered with. Everything else is the
scene of the unmodified task.
"""

from __future__ import annotations

import hashlib
import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.substrates.embedded.objects import category, parts
from pytest_libero_max.substrates.embedded.objects.parts import Category, drawn
from pytest_libero_max.substrates.embedded.scene import Region, Scene, resolve
from pytest_libero_max.substrates.embedded.surfaces import SURFACES, shown
from pytest_libero_max.worlds.contract import Entity, Image
from pytest_libero_max.worlds.privileged import Fact

_ASSET_ORDER = MappingProxyType({"texture": 0, "mesh": 1, "material": 2})


@dataclass(frozen=True)
class Remodel:
    """Differences of a scene from that of the unmodified task."""

    extras: tuple[tuple[str, str], ...] = ()
    """Instance and category of each object that is added."""
    recast: tuple[tuple[str, str, str], ...] = ()
    """Instance that is replaced, the new instance's name, and its category."""
    surfaces: tuple[str, ...] = ()
    """Names of :data:`.surfaces.SURFACES` that are loaded as textures."""

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Remodel:
        """Read the ``scene`` of a source variation, or raise SubstrateError."""
        known = ("extras", "recast", "surfaces")
        for key in raw:
            if key not in known:
                raise SubstrateError(f"scene field {key!r} is not known. {did_you_mean(key, known)}")
        return cls(
            extras=tuple((name, kind) for name, kind in raw.get("extras", ())),
            recast=tuple((old, new, kind) for old, new, kind in raw.get("recast", ())),
            surfaces=tuple(raw.get("surfaces", ())),
        )

    @property
    def key(self) -> str:
        """A short name for it; empty for a scene as it is."""
        parts = (self.extras, self.recast, self.surfaces)
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12] if any(parts) else ""

    def renamed(self, name: str) -> str:
        """Name in this scene of an instance, a region or a joint of the unmodified one."""
        for old, new, _ in self.recast:
            if name == old or name.startswith(f"{old}_"):
                return new + name[len(old) :]
        return name


def remodelled(scene: Scene, plan: Remodel) -> Scene:
    """Return the scene of a task, altered as ``plan`` says, or raise SubstrateError."""
    root = ET.fromstring(scene.mjcf)
    assets, worldbody = root.find("asset"), root.find("worldbody")
    assert assets is not None
    assert worldbody is not None
    pictures: dict[str, Image] = dict(scene.textures)
    entities, regions = dict(scene.entities), dict(scene.regions)
    for old, new, kind in plan.recast:
        entities, regions = _recast(worldbody, entities, regions, (old, new, category(kind)))
    for number, (instance, kind) in enumerate(plan.extras):
        entities = _add(worldbody, entities, instance, category(kind), number)
    for name in dict.fromkeys(kind for *_, kind in (*plan.recast, *plan.extras)):
        pictures |= _add_assets(assets, category(name))
    for surface in plan.surfaces:
        pictures |= _add_surface(assets, surface)
    assets[:] = sorted(assets, key=lambda element: _ASSET_ORDER[element.tag])
    goal = tuple(_renamed_fact(fact, plan) for fact in scene.task.goal)
    return replace(
        scene,
        mjcf=ET.tostring(root, encoding="unicode"),
        textures=pictures,
        entities=entities,
        regions=regions,
        goal=tuple(resolve(fact, entities, regions) for fact in goal),
        task=replace(scene.task, goal=goal),
    )


def _renamed_fact(fact: Fact, plan: Remodel) -> Fact:
    place = None if fact.place is None else plan.renamed(fact.place)
    return replace(fact, subject=plan.renamed(fact.subject), place=place)


def _recast(
    worldbody: ET.Element,
    entities: Mapping[str, Entity],
    regions: Mapping[str, Region],
    change: tuple[str, str, Category],
) -> tuple[dict[str, Entity], dict[str, Region]]:
    old, new, kind = change
    if old not in entities or entities[old].kind == "surface":
        raise SubstrateError(f"{old!r} cannot be replaced by {new!r}. {did_you_mean(old, entities)}")
    if new != old and new in entities:
        raise SubstrateError(f"{new!r} is in the scene already and cannot replace {old!r}.")
    place, element = next(
        (place, element)
        for place, element in enumerate(worldbody)
        if element.tag == "body" and element.get("name") == entities[old].body
    )
    pos, quat = (
        [float(part) for part in (element.get(attribute) or "").split()] for attribute in ("pos", "quat")
    )
    worldbody[place] = parts.body(kind, new, pos, (quat[0], quat[1], quat[2], quat[3]))

    def name(text: str) -> str:
        return new + text[len(old) :] if text == old or text.startswith(f"{old}_") else text

    body = f"{new}_{kind.root.name}"
    changed = {
        name(key): replace(entity, name=new, category=kind.name, body=body)
        if key == old
        else replace(entity, support=None if entity.support is None else name(entity.support))
        for key, entity in entities.items()
    }
    moved = {
        name(key): Region(name(key), new, tuple(name(joint) for joint in region.joints))
        if region.target == old
        else region
        for key, region in regions.items()
    }
    return changed, moved


def _add(
    worldbody: ET.Element, entities: Mapping[str, Entity], instance: str, kind: Category, number: int
) -> dict[str, Entity]:
    if instance in entities:
        raise SubstrateError(f"{instance!r} is in the scene already and cannot be added to it.")
    worldbody.append(parts.body(kind, instance, waiting_place(number), kind.upright))
    surface = next(entity.name for entity in entities.values() if entity.kind == "surface")
    body = f"{instance}_{kind.root.name}"
    return {**entities, instance: Entity(instance, kind.name, "object", body, surface)}


def waiting_place(number: int) -> tuple[float, float, float]:
    """Place of the ``number``-th added object while it is out of the scene, m, world."""
    return (-2.0 - 0.2 * number, 2.0, -5.0)


def _add_assets(assets: ET.Element, kind: Category) -> dict[str, Image]:
    known = {(element.tag, element.get("name")) for element in assets}
    elements, pictures = parts.assets(kind)
    assets.extend(element for element in elements if (element.tag, element.get("name")) not in known)
    return pictures


def _add_surface(assets: ET.Element, surface: str) -> dict[str, Image]:
    if surface not in SURFACES:
        raise SubstrateError.seen("surface", surface, f" does not exist. {did_you_mean(surface, SURFACES)}")
    name, picture = shown(surface), drawn(SURFACES[surface])
    assets.append(parts.texture_element(name, picture))
    return {name: picture}
