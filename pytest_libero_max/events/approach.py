"""The way of the open hand to a case's trigger, which depends on no policy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, TRIGGER_DISTANCE_M, Case
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.schedules import trigger_of
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.worlds.contract import World, alterable

_STEP_M = 0.05  # what the controller makes of a full translation action
_APPROACH_STEPS = 160
_HIGH_M = 0.35  # above the trigger entity: over everything that stands on a table
_NEAR_M = 0.01
_TILT_STEPS = 2  # of a full rotation action, together 1 rad
_TILTING = 5  # components before the gripper's, from which on a robot turns its hand


@dataclass(frozen=True)
class _Aim:
    """Places of the hand, from the trigger entity, m, and its turns: rotation actions about x and y.

    The robot stands at negative x and looks along x. Beside a cabinet the fingers point at it, or the hand is
    too wide to come near.
    """

    offset_m: tuple[float, float, float]
    tilt: tuple[float, float] = (0.0, 0.0)


_AIMS: Mapping[str, _Aim] = MappingProxyType(
    {
        "above": _Aim((0.0, 0.0, 0.1)),
        "left": _Aim((0.0, 0.16, 0.03), (-1.0, 0.0)),
        "right": _Aim((0.0, -0.16, 0.03), (1.0, 0.0)),
        "in front": _Aim((-0.16, 0.0, 0.03), (0.0, -1.0)),
    }
)


WAYS = tuple((name, high) for name in _AIMS for high in (False, True))
"""Ways to the trigger entity: a place beside it, and True for first up, then across and down."""


def approach(world: World, case: Case) -> tuple[str, bool] | None:
    """Start the case and drive the open hand within the trigger distance, on the first way that leads there.

    The ways: straight to a place above, left, right or in front of the trigger entity, or first up, then
    across and down. A way on which the task is solved does not count.

    Returns:
        The way, as the place and whether it led up first; None where none leads there.
    """
    for name, high in WAYS:
        begin(world, case)
        if _go(world, case, _AIMS[name], high) and not world.succeeded():
            return name, high
    return None


def proximity_of(case: Case) -> Proximity:
    """Return the trigger of a case as the place to drive the hand to, or raise ManifestError."""
    trigger = trigger_of(case)
    if not isinstance(trigger, Proximity):
        raise ManifestError(
            f"case {case.case_id!r}: scenario.trigger.type={trigger.type!r}, but the hand is only driven "
            f"near an entity ({Proximity.type!r}), and nothing else is made to happen. Leave the case out."
        )
    return trigger


def _go(world: World, case: Case, aim: _Aim, high: bool) -> bool:
    trigger = proximity_of(case)
    nearness = trigger.distance_m / TRIGGER_DISTANCE_M  # beside the entity means within the trigger distance
    goal = world.position(trigger.entity) + np.multiply(aim.offset_m, nearness)
    top = float(world.position(trigger.entity)[2]) + _HIGH_M
    points = [np.array([*world.end_effector()[:2], top]), np.array([*goal[:2], top])] if high else []
    for step in range(_APPROACH_STEPS):
        if trigger.reached(world):
            return True
        if points and float(abs(points[0] - world.end_effector()).max()) < _NEAR_M:
            points.pop(0)
        way = (points[0] if points else goal) - world.end_effector()
        action = np.array(world.robot.noop)
        action[:3] = way / max(_STEP_M, float(abs(way).max()))
        if step < _TILT_STEPS and len(action) > _TILTING:
            action[3:5] = aim.tilt
        world.step(action)
    return False


def begin(world: World, case: Case) -> None:
    """Reset a world to the start of a case, with its setup, and let it settle."""
    world.reset(case.init_state_index)
    for raw in case.event.setup:
        change_from_dict(raw).apply(alterable(world))
    hold(world, SETTLE_STEPS)


def hold(world: World, steps: int) -> None:
    """Hold a world still for some control steps."""
    for _ in range(steps):
        world.step(world.robot.noop)
