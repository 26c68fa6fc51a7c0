"""One scene of the embedded substrate: room, fixtures, objects, regions and goal, without the robot."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass

from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.substrates.embedded.arenas import ARENAS, Arena, furnish
from pytest_libero_max.substrates.embedded.objects import category, parts
from pytest_libero_max.substrates.embedded.objects.parts import Link, links
from pytest_libero_max.substrates.embedded.predicates import In, Joints, OnObject, OnSite, Predicate
from pytest_libero_max.tasks.libero_tasks import Task, category_of, task
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array, Entity, Image
from pytest_libero_max.worlds.privileged import Fact, GraspablePart


@dataclass(frozen=True)
class Region:
    """A named part of a surface, fixture or object."""

    name: str
    """As in LIBERO; also the name of its MuJoCo site."""
    target: str
    """The entity it belongs to."""
    joints: tuple[str, ...] = ()
    """Joints of the drawer it belongs to."""


@dataclass(frozen=True)
class Scene:
    """Everything a substrate needs to host a task."""

    suite: str
    index: int
    name: str
    """Stem of LIBERO's BDDL file."""
    language: str
    mount: str
    """Base that the robot stands on: ``rethink`` (a pedestal behind the table) or ``ground``."""
    robot_base_pos: tuple[float, float, float]
    """Position of the robot's base, m, world."""
    mjcf: str
    """A complete MJCF document without the robot."""
    textures: Mapping[str, Image]
    """Pictures by texture name; :func:`.textures.upload` writes them into a compiled model."""
    entities: Mapping[str, Entity]
    """Objects in the order of their joints, then fixtures, then the surface."""
    regions: Mapping[str, Region]
    goal: tuple[Predicate, ...]
    """A conjunction."""
    task: Task

    @property
    def key(self) -> str:
        """``libero_spatial/0``."""
        return f"{self.suite}/{self.index}"


def build_scene(suite: str, index: int) -> Scene:
    """Build the scene of a task, or raise SubstrateError.

    Args:
        suite: One of :data:`.tasks.SUITES`.
        index: The benchmark's task index, from 0.
    """
    row = task(suite, index)
    arena = ARENAS[row.arena]
    entities = _entities(row, arena)
    regions = _regions(row)
    document, pictures = _document(row, arena)
    return Scene(
        suite=suite,
        index=index,
        name=row.name,
        language=row.language,
        mount=arena.mount,
        robot_base_pos=arena.robot_base_pos,
        mjcf=document,
        textures=pictures,
        entities=entities,
        regions=regions,
        goal=tuple(resolve(fact, entities, regions) for fact in row.goal),
        task=row,
    )


def resolve(fact: Fact, entities: Mapping[str, Entity], regions: Mapping[str, Region]) -> Predicate:
    """Turn a predicate of names into one that can be evaluated, or raise SubstrateError."""
    subject = fact.subject
    if fact.predicate in ("open", "close", "turnon", "turnoff"):
        state = joint_state(fact, entities, regions)
        joints = joints_of(subject, entities, regions)
        return Joints(joints, state.low, state.high, state.every, state.closed)
    body = _entity(subject, entities).body
    place = fact.place or ""
    if place in regions:
        if fact.predicate == "in":
            return In(body, place)
        target = entities[regions[place].target]
        return OnSite(body, place, None if target.kind == "surface" else target.body)
    return OnObject(body, _entity(place, entities).body)


def _entity(name: str, entities: Mapping[str, Entity]) -> Entity:
    if name not in entities:
        raise SubstrateError(f"{name!r} is not in this scene. {did_you_mean(name, entities)}")
    return entities[name]


def joint_state(
    fact: Fact, entities: Mapping[str, Entity], regions: Mapping[str, Region]
) -> parts.JointState:
    """Predicate of open, closed, on or off for the joints of a fixture or of one of its regions.

    Raises:
        SubstrateError: The fixture does not exist or cannot be in such a state.
    """
    name = regions[fact.subject].target if fact.subject in regions else fact.subject
    kind = category(_entity(name, entities).category)
    if fact.predicate not in kind.states:
        raise SubstrateError.seen(
            "predicate",
            fact.predicate,
            f" means nothing for {fact.subject!r}. {did_you_mean(fact.predicate, kind.states)}",
        )
    return kind.states[fact.predicate]


def joints_of(name: str, entities: Mapping[str, Entity], regions: Mapping[str, Region]) -> tuple[str, ...]:
    """Return the joints of a fixture, or those that a region of it moves with."""
    if name in regions:
        return regions[name].joints
    return tuple(f"{name}_{joint}" for joint in _joint_names(category(_entity(name, entities).category).root))


def _entities(row: Task, arena: Arena) -> dict[str, Entity]:
    supports = {fact.subject: fact.place for fact in row.start if fact.place is not None}
    entities = {}
    for instance in (*row.objects, *row.fixtures):
        kind = category(category_of(instance))
        entities[instance] = Entity(
            name=instance,
            category=kind.name,
            kind="fixture" if kind.fixture else "object",
            body=f"{instance}_{kind.root.name}",
            support=_owner(supports[instance], row),
        )
    entities[arena.surface] = Entity(arena.surface, arena.surface, "surface", arena.surface_body)
    return entities


def _owner(place: str, row: Task) -> str:
    if place in row.places:
        return row.places[place].surface
    return next(
        name for name in (*row.objects, *row.fixtures) if place == name or place.startswith(f"{name}_")
    )


def _regions(row: Task) -> dict[str, Region]:
    regions = {place.name: Region(place.name, place.surface) for place in row.places.values()}
    for instance in (*row.objects, *row.fixtures):
        for link in links(category(category_of(instance)).root):
            joints = () if link.joint is None else (f"{instance}_{link.joint.name}",)
            for site in link.sites:
                regions[f"{instance}_{site.name}"] = Region(f"{instance}_{site.name}", instance, joints)
    return regions


def _joint_names(root: Link) -> tuple[str, ...]:
    return tuple(link.joint.name for link in links(root) if link.joint is not None)


def _document(row: Task, arena: Arena) -> tuple[str, dict[str, Image]]:
    root = ET.Element("mujoco", {"model": f"{row.suite}_{row.index}"})
    ET.SubElement(root, "compiler", {"angle": "radian", "autolimits": "true", "inertiagrouprange": "0 0"})
    option = {
        "timestep": "0.002",
        "cone": "elliptic",
        "impratio": "20",
        "density": "1.2",
        "viscosity": "0.00002",
    }
    ET.SubElement(root, "option", option)
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "headlight", {"ambient": "0 0 0", "diffuse": "0.12 0.12 0.12", "specular": "0 0 0"})
    ET.SubElement(visual, "map", {"znear": "0.01", "zfar": "20"})
    ET.SubElement(root, "statistic", {"extent": "1", "center": "0 0 0.9"})
    assets, worldbody = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    pictures, surface = furnish(row.arena, assets, worldbody)
    for place in row.places.values():
        x0, y0, x1, y1 = place.box
        centre = ((x0 + x1) / 2, (y0 + y1) / 2, arena.region_z)
        surface.append(parts.site_element(place.name, centre, ((x1 - x0) / 2, (y1 - y0) / 2, 0.007)))
    for name in dict.fromkeys(category_of(instance) for instance in (*row.objects, *row.fixtures)):
        elements, shared = parts.assets(category(name))
        assets.extend(elements)
        pictures |= shared
    _order_textures_first(assets)
    starts = {fact.subject: fact.place for fact in row.start if fact.place in row.places}
    for number, instance in enumerate(row.objects):
        kind = category(category_of(instance))
        # Objects wait in a row beside the scene until an initial state puts them in their places.
        waiting = (2.0, -1.0 + 0.3 * number, arena.top_z + 0.5)
        worldbody.append(parts.body(kind, instance, waiting, kind.upright))
    for instance in row.fixtures:
        place = row.places[starts[instance] or ""]
        x0, y0, x1, y1 = place.box
        kind = category(category_of(instance))
        pos = ((x0 + x1) / 2, (y0 + y1) / 2, arena.fixture_z + kind.lift)
        worldbody.append(parts.body(kind, instance, pos, rotations.about((0, 0, 1), place.yaw)))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode"), pictures


def _order_textures_first(assets: ET.Element) -> None:
    """Materials refer to textures by name; a reader of the document finds them in that order."""
    order = {"texture": 0, "mesh": 1, "material": 2}
    assets[:] = sorted(assets, key=lambda element: order[element.tag])


def graspable_parts(scene: Scene) -> Mapping[str, GraspablePart]:
    """Parts of a scene that are made to be held, by name: handles of drawers and doors, knobs, necks, rims.

    A name is ``<instance>_<part>``, for example ``wooden_cabinet_1_top_handle`` or ``wine_bottle_1_neck``.
    """
    parts = {}
    for entity in scene.entities.values():
        if entity.kind == "surface":
            continue
        kind = category(entity.category)
        back = rotations.matrix(rotations.inverse(kind.upright))
        for link in links(kind.root):
            joint = None if link.joint is None else f"{entity.name}_{link.joint.name}"
            for grip in link.grips:
                name = f"{entity.name}_{grip.name}"
                pos, along, out = (_vector(back @ vector) for vector in (grip.pos, grip.along, grip.out))
                parts[name] = GraspablePart(
                    name, entity.name, f"{entity.name}_{link.name}", joint, pos, along, out, grip.width
                )
    return parts


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 9) + 0.0 for value in values)
    return x, y, z
