"""Rules of the contract of worlds: members, actions and their meaning."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from pytest_libero_max.conformance.rules import Finding, broken, judged, kept, rule, unexamined
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject
from pytest_libero_max.errors import ActionError, SubstrateError, counted
from pytest_libero_max.worlds.contract import OnMujoco, World

OPENS = "substrate/contract/opens"

_MOVE_S, _GRIP_S = 0.3, 0.5
"""Time of a movement in one direction, and of one of the gripper."""

_LEAST_M = 0.01
"""Least way of the hand in the former, m: 1.7 mm a step of LIBERO's, where an action asks for up to 5 cm."""


@rule(OPENS, "must")
def opens(subject: SubstrateSubject) -> Finding:
    """Open, and build the world of a first case with every member of a world."""
    world = subject.world
    if not isinstance(world, World):
        members = sorted(name for name in dir(World) if not name.startswith("_") and not hasattr(world, name))
        return broken(
            f"{type(world).__name__} lacks {', '.join(members)}",
            "every member of pytest_libero_max.worlds.contract.World",
            "Add them.",
        )
    return kept(f"{world.scene}; {counted(len(subject.cases), 'case')} of its track can be played")


@rule("substrate/contract/actions", "must", needs=OPENS)
def refuses_actions(subject: SubstrateSubject) -> Iterator[Finding]:
    """Refuse an action of another shape or that is not finite, with an ActionError."""
    world = subject.begin()
    before, noop = world.digest(), world.robot.noop
    for what, action in (
        (f"an action of {counted(len(noop) - 1, 'component')}", noop[:-1]),
        ("an action with NaN", (np.nan, *noop[1:])),
        ("an action with infinity", (0.0, np.inf, *noop[2:])),
    ):
        if instead := _instead_of(ActionError, world.step, action):
            yield broken(f"{what} {instead}", "an ActionError", "Check actions in step().")
    altered = world.digest() != before
    yield judged(
        not altered,
        "a refused action altered the world"
        if altered
        else "actions of another shape and that are not finite are refused",
        "a world as it was",
        "Check actions first.",
    )


def _instead_of(error: type[Exception], act: Callable[[Any], None], argument: Any) -> str:
    """Return what happened in place of an error, in words; empty where it was raised."""
    try:
        act(argument)
    except error:
        return ""
    except Exception as other:  # a substrate of others may raise anything
        return f"raised {type(other).__name__}: {other}"
    return "was played"


@rule("substrate/contract/inits", "must", needs=OPENS)
def refuses_inits(subject: SubstrateSubject) -> Finding:
    """Refuse an initial state that the scene does not have, with a SubstrateError."""
    world = subject.world
    for init in (-1, 10**6):
        if instead := _instead_of(SubstrateError, world.reset, init):
            return broken(f"reset({init}) {instead}", "a SubstrateError", "Check the index in reset().")
    return kept("initial states that do not exist are refused")


@rule("substrate/contract/rate", "must", needs=OPENS)
def control_rate(subject: SubstrateSubject) -> Finding:
    """Advance the simulator by one control step of its robot in a step: 50 ms for LIBERO's."""
    world = subject.begin()
    if not isinstance(world, OnMujoco):
        return unexamined("the world has no clock of MuJoCo")
    before, hz = world.data.time, world.robot.control_hz
    for _ in range(hz):
        world.step(world.robot.noop)
    seconds = world.data.time - before
    return judged(
        abs(seconds - 1.0) < 1e-6,
        f"{counted(hz, 'step')} take {seconds:.3f} s of simulated time",
        "1 s",
        f"The control rate of robot {world.robot.name!r} is {hz} Hz: budgets of steps are times.",
    )


@rule("substrate/contract/directions", "must", needs=OPENS)
def directions(subject: SubstrateSubject) -> Finding:
    """Move the hand along the axis of the world that an action names."""
    for axis, name in enumerate("xyz"):
        for sign in (1.0, -1.0):
            world = subject.begin()
            start = np.array(world.end_effector())
            action = np.array(world.robot.noop)
            action[axis] = sign
            steps = round(_MOVE_S * world.robot.control_hz)
            for _ in range(steps):
                world.step(action)
            way = np.asarray(world.end_effector()) - start
            if sign * way[axis] < _LEAST_M or abs(way[axis]) < np.abs(way).max():
                return broken(
                    f"{steps} actions of {sign:+.0f} in {name} move the hand by "
                    f"({', '.join(f'{value:+.3f}' for value in way)}) m",
                    f"{sign * _LEAST_M:+.2f} m in {name} at least, more than in any other direction",
                    "The order, the sign or the frame of the action differs.",
                )
    return kept("an action moves the hand along the axis that it names")


@rule("substrate/contract/gripper", "must", needs=OPENS)
def gripper(subject: SubstrateSubject) -> Finding:
    """Open the gripper with the sign of the no-op's last component, LIBERO's -1; close it with the other."""
    world = subject.begin()
    openings, opening = [], world.robot.opening
    for sign in (opening, -opening, opening):
        for _ in range(round(_GRIP_S * world.robot.control_hz)):
            world.step((*world.robot.noop[:-1], sign))
        openings.append(float(np.abs(world.observe(())[world.robot.fingers_key]).sum()))
    opened, closed, reopened = openings
    signs = f"{opening:+.0f}, {-opening:+.0f}, {opening:+.0f}"
    text = f"openings after {signs}: {opened:.3f}, {closed:.3f}, {reopened:.3f} m"
    return judged(
        closed < 0.5 * opened and reopened > 2 * closed,
        text,
        f"a small one after {-opening:+.0f} only",
        "The sign of the gripper, or of the last component of the robot's noop, is the wrong way round.",
    )
