"""Factors of a world that a change may touch: read before and after it, measured, and written again."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from pytest_libero_max.errors import ChangeError
from pytest_libero_max.worlds.contract import AlterableWorld, PixelFilter
from pytest_libero_max.worlds.scenery import Scenery, is_same, with_former

Factor = str
"""``camera:<name>``, ``light``, ``material``, ``pixels``, ``state`` (the robot's, as a policy is shown it),
``robot``, ``instruction``, ``goal`` or ``pose:<entity>``."""

Filters = tuple[tuple[PixelFilter, int], ...]


class Place(NamedTuple):
    """Place of an entity, in the scene or out of it."""

    position_m: tuple[float, ...]
    quaternion_wxyz: tuple[float, ...]
    taken_out_of: tuple[tuple[float, ...], tuple[float, ...]] | None
    """Position and orientation that it had in the scene, while it is out of it; None while it is there."""


@dataclass(frozen=True, eq=False)
class Former:
    """A factor that a change has altered."""

    factor: Factor
    before: Any
    """Value before the change, as the factor's kind reads it."""
    after: Any
    """Value just after it."""

    @property
    def kind(self) -> str:
        return self.factor.partition(":")[0]

    @property
    def name(self) -> str:
        """Camera or entity; empty for a factor of the whole world."""
        return self.factor.partition(":")[2]

    def write_back(self, world: AlterableWorld) -> None:
        """Let the factor be again what it was before the change; what else has changed since stays.

        Raises:
            ChangeError: A filter to remove is not there, or no such factor can be taken back.
        """
        if self.kind not in _KINDS:
            raise ChangeError.seen(
                "factor",
                self.factor,
                f" cannot be taken back; {', '.join(_KINDS)} can. Leave its reversal out.",
            )
        _KINDS[self.kind].write_back(world, self)


def read(world: AlterableWorld, factors: Iterable[Factor]) -> list[tuple[Factor, Any]]:
    """Return the values of factors now, as copies."""
    values = []
    for factor in factors:
        kind, _, name = factor.partition(":")
        values.append((factor, _KINDS[kind].read(world, name) if kind in _KINDS else None))
    return values


def altered(world: AlterableWorld, before: Iterable[tuple[Factor, Any]]) -> tuple[Former, ...]:
    """Return those factors that have another value now; a factor of an unknown kind counts as altered."""
    pairs = [(factor, old, read(world, [factor])[0][1]) for factor, old in before]
    return tuple(
        Former(factor, old, new) for factor, old, new in pairs if old is None is new or not _is_same(old, new)
    )


def _is_same(old: Any, new: Any) -> bool:
    return is_same(old, new) if hasattr(old, "IN_ROWS") else bool(old == new)


def filter_records(world: AlterableWorld) -> list[dict[str, Any]]:
    """Return the world's active pixel filters as JSON values, in the order in which they act."""
    return [filter_record(pixel_filter, since) for pixel_filter, since in world.filters]


def filter_record(pixel_filter: PixelFilter, since: int) -> dict[str, Any]:
    """Return a pixel filter and the step at which it was added, as JSON values."""
    value: Any = pixel_filter
    known = fields(value) if is_dataclass(value) else ()
    values = {field.name: getattr(value, field.name) for field in known if field.repr}
    parameters = {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}
    return {"filter": type(pixel_filter).__name__, "since_step": since, **parameters}


def measure_poses(world: AlterableWorld, names: Iterable[str]) -> dict[str, Any]:
    """Return the positions of the entities named, for the evidence."""
    poses = {name: world.pose(name) for name in names}
    return {
        "position_m": {name: [float(v) for v in position] for name, (position, _) in poses.items()},
        "quaternion_wxyz": {name: [float(v) for v in quaternion] for name, (_, quaternion) in poses.items()},
        "taken_out": [name for name in poses if name in world.parked],
    }


class _Kind(NamedTuple):
    read: Callable[[AlterableWorld, str], Any]
    write_back: Callable[[AlterableWorld, Former], None]


def _write_view(world: AlterableWorld, former: Former) -> None:
    world.set_view(former.name, _with_former(world.view(former.name), former))


def _write_lights(world: AlterableWorld, former: Former) -> None:
    world.set_lights(_with_former(world.lights(), former))


def _write_surfaces(world: AlterableWorld, former: Former) -> None:
    world.set_surfaces(_with_former(world.surfaces(), former))


def _with_former(now: Scenery, former: Former) -> Scenery:
    restored: Scenery = with_former(now, former.before, former.after)
    return restored


def _remove_filters(world: AlterableWorld, former: Former) -> None:
    before: Filters = former.before
    after: Filters = former.after
    for added in after[len(before) :]:
        matches = [number for number, known in enumerate(world.filters) if known == added]
        if not matches:
            raise ChangeError(
                f"The filter {filter_record(*added)!r} is not active any more. Take a change back once."
            )
        world.remove_filter(matches[-1])


def _read_place(world: AlterableWorld, name: str) -> Place:
    position, quaternion = world.pose(name)
    out = None
    if name in world.parked:
        there, turn = world.parked_pose(name)
        out = (tuple(there.tolist()), tuple(turn.tolist()))
    return Place(tuple(position.tolist()), tuple(quaternion.tolist()), out)


def _put_back(world: AlterableWorld, former: Former) -> None:
    name, place = former.name, former.before
    if place.taken_out_of is None:
        put = world.unpark if name in world.parked else world.place
        put(name, place.position_m, place.quaternion_wxyz)
    else:
        world.place(name, *place.taken_out_of)
        world.park(name, place.position_m)


_KINDS = MappingProxyType(
    {
        "camera": _Kind(lambda world, name: world.view(name), _write_view),
        "light": _Kind(lambda world, _: world.lights(), _write_lights),
        "material": _Kind(lambda world, _: world.surfaces(), _write_surfaces),
        "pixels": _Kind(lambda world, _: world.filters, _remove_filters),
        "state": _Kind(lambda world, _: (), lambda world, _: None),  # a filter hides it, see pixels
        "robot": _Kind(
            lambda world, _: tuple(world.arm_joints().tolist()),
            lambda world, former: world.pose_arm(former.before),
        ),
        "instruction": _Kind(
            lambda world, _: (world.assigned[0],),
            lambda world, former: world.reassign((*former.before, world.assigned[1])),
        ),
        "goal": _Kind(
            lambda world, _: (world.assigned[1],),
            lambda world, former: world.reassign((world.assigned[0], *former.before)),
        ),
        "pose": _Kind(_read_place, _put_back),
    }
)
