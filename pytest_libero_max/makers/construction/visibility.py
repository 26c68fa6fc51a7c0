"""Visibility of the goal's entities to a policy's cameras around an event: pixels, occlusion included."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.registry import contents_of, own_variation
from pytest_libero_max.substrates.variation import variation_metadata
from pytest_libero_max.tasks.contents import owner
from pytest_libero_max.worlds.contract import World
from pytest_libero_max.worlds.privileged import PrivilegedWorld

IMAGE_SIZE = 256
"""Side of the images in which pixels are counted."""

MIN_PIXELS = 30
"""An entity is *seen* by a camera that shows this many pixels of it or more. The smallest one of the embedded
scenes, a box of butter, has about 150 in an agent's view that nothing stands in."""

Pixels = Mapping[str, Mapping[str, int]]
"""Pixels by camera of each entity that is in its image."""


class Sight(Struct, frozen=True, array_like=True):
    """Number of pixels that show an entity just before the event and just after it."""

    role: str
    """``target`` (the entity that the trigger watches) or ``receptacle``."""
    entity: str
    """Its name."""
    before: tuple[int, ...]
    """By camera of the robot, in its order."""
    after: tuple[int, ...]
    """Likewise."""

    @property
    def seen_before(self) -> bool:
        """True if any camera saw it."""
        return max(self.before) >= MIN_PIXELS

    @property
    def seen_after(self) -> bool:
        """True if any camera sees it."""
        return max(self.after) >= MIN_PIXELS


def look(world: World) -> Pixels:
    """Return the pixels of every entity now, in each camera of a policy."""
    return {camera: world.visible_pixels(camera, IMAGE_SIZE) for camera in world.robot.cameras}


def pixels_of(entity: str, seen: Pixels) -> tuple[int, ...]:
    """Return the pixels of an entity, by camera; 0 where it is not in the image."""
    return tuple(pixels.get(entity, 0) for pixels in seen.values())


def sights(world: World, case: Case, before: Pixels, after: Pixels) -> tuple[Sight, ...]:
    """Visibility of the case's target and, where it has one, of its receptacle.

    A receptacle that is the table or the floor is left out: it is always in view.
    """
    return tuple(
        Sight(role, entity, pixels_of(entity, before), pixels_of(entity, after))
        for role, entity in _roles(world, case).items()
        if entity in world.entities and world.entities[entity].kind != "surface"
    )


def _roles(world: World, case: Case) -> dict[str, str]:
    roles = {"target": case.event.entity}
    if isinstance(world, PrivilegedWorld):
        receptacle = _receptacle_of(world)
        return roles if receptacle is None else {**roles, "receptacle": receptacle}
    try:
        if case.unmodified:
            task = contents_of(case.suite, case.task_index)
        else:
            task = variation_metadata(own_variation(case))
    except SubstrateError:  # a case of other catalogues, whose goal is not known here
        return roles
    if task.primary_receptacle is not None:
        roles["receptacle"] = task.primary_receptacle
    return roles


def _receptacle_of(world: PrivilegedWorld) -> str | None:
    """Destination of the first object that the goal names, as :attr:`.TaskMetadata.primary_receptacle`."""
    subjects = (fact.subject for fact in world.goal if fact.subject in world.entities)
    target = next((name for name in subjects if world.entities[name].kind == "object"), None)
    places = (fact.place for fact in world.goal if fact.subject == target and fact.place is not None)
    return next(
        (receptacle for place in places if (receptacle := owner(place, world.entities)) is not None), None
    )
