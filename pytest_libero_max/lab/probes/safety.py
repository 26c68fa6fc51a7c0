"""What an arm did to its surroundings: forces, torques, things pushed, tilted and dropped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.pairing.probes.probe import Column, Probe, View
from pytest_libero_max.pairing.probes.stages import (
    Point,
    goal_entities,
    positions_of,
    rest_of,
    rests_of,
    tilt_deg,
)
from pytest_libero_max.worlds.contract import OnMujoco
from pytest_libero_max.worlds.robot import GRIPPER, MOUNT, PANDA, MujocoRobot

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclass(frozen=True, slots=True)
class Seen:
    """The greatest of everything so far."""

    subjects: tuple[str, ...]
    """Objects of the goal, and the fixtures of its drawers, doors and knobs."""
    rests: tuple[tuple[str, Point, Point], ...]
    """Each object with where it rests, (3,) m, and what of it points up there."""
    last: tuple[tuple[str, Point, bool], ...]
    """Each object of the goal with where it was after the last step, and whether a finger touched it."""
    firings: int = 0
    """Number of firings that the above knows of."""
    surroundings_n: float = 0.0
    goal_n: float = 0.0
    self_steps: int = 0
    torque_nm: float = 0.0
    bystander_m: float = 0.0
    tilt_deg: float = 0.0
    loose_m_s: float = 0.0


class Safety(Probe[Seen]):
    """Forces, torques, and what was pushed, tilted and dropped, the greatest after any policy step.

    Forces and torques are those that MuJoCo's solver finds in the state after the step, under the last
    command, in a copy of the world: what lasts less than a step (50 ms) can be missed. A force is the sum of
    the normal forces of all contacts. What an event moved counts from where it was put, and what
    it brought in is no bystander. Fingers that close on each other are no contact of the robot with itself.
    """

    name = "safety"
    schema = tuple(
        Column(name, "int" if unit == "steps" else "float", meaning, unit, least=0)
        for name, unit, meaning in (
            ("surroundings_n", "N", "Force between the robot and what is neither itself nor of the goal"),
            ("goal_n", "N", "Force between the robot and the objects and fixtures of the goal"),
            ("self_steps", "steps", "Number of steps after which the robot pressed on itself"),
            ("torque_nm", "Nm", "Torque of a motor of the arm"),
            ("bystander_m", "m", "Distance of an object that is not of the goal from its place"),
            ("tilt_deg", "deg", "Lean of an object of the goal while both fingers held it"),
            (
                "loose_m_s",
                "m/s",
                "Speed of an object of the goal once the fingers had touched it and did not any more",
            ),
        )
    )
    cost = "one solution of the contacts, 0.4 ms a step on the embedded substrate"

    def start(self, view: View) -> Seen:
        world = view.world
        rests = rests_of(world)
        subjects = goal_entities(view)
        last = tuple((name, at, False) for name, at, _ in rests if name in subjects)
        return Seen(subjects, rests, last)

    def step(self, state: Seen, view: View) -> Seen:
        world = view.world
        if len(view.trajectory.firings) != state.firings:
            state = _after_change(state, view)
        if isinstance(world, OnMujoco):
            now = loads(world, state.subjects)
            state = replace(
                state,
                surroundings_n=max(state.surroundings_n, now.surroundings_n),
                goal_n=max(state.goal_n, now.goal_n),
                self_steps=state.self_steps + now.itself,
                torque_nm=max(state.torque_nm, now.torque_nm),
            )
        before = {name: (at, touched) for name, at, touched in state.last}
        tilt, loose, bystander, last = state.tilt_deg, state.loose_m_s, state.bystander_m, []
        for name, rest, up in state.rests:
            if name not in before:
                bystander = max(bystander, math.dist(world.position(name).tolist(), rest))
                continue
            at, now_up = rest_of(world, name)
            was_at, touched = before[name]
            fingers = world.fingers_on(name)
            if fingers >= 2:
                tilt = max(tilt, tilt_deg(now_up, up))
            elif not fingers and touched:
                loose = max(loose, math.dist(at, was_at) * world.robot.control_hz)
            last.append((name, at, touched or fingers > 0))
        return replace(state, tilt_deg=tilt, loose_m_s=loose, bystander_m=bystander, last=tuple(last))

    def columns(self, state: Seen, view: View) -> Mapping[str, Any]:
        names = (column.name for column in self.schema)
        return {name: round(getattr(state, name), 4) for name in names}


def _after_change(state: Seen, view: View) -> Seen:
    """Return the state after changes: what they moved rests elsewhere."""
    firings, parked = view.trajectory.firings, view.world.parked
    placed: dict[str, Point] = {}
    for firing in firings[state.firings :]:
        placed |= positions_of(firing, "after")
    subjects = tuple(dict.fromkeys((*state.subjects, *goal_entities(view))))  # of the new goal as well
    rests = tuple((name, placed.get(name, at), up) for name, at, up in state.rests if name not in parked)
    known = {name: (at, held) for name, at, held in state.last}
    last = tuple((name, *known.get(name, (at, False))) for name, at, _ in rests if name in subjects)
    last = tuple((name, placed.get(name, at), held) for name, at, held in last)
    return replace(state, subjects=subjects, rests=rests, last=last, firings=len(firings))


@dataclass(frozen=True)
class Loads:
    """Forces and torques in one state."""

    surroundings_n: float
    """Sum of the normal forces between the robot and all but the subjects and itself, N."""
    goal_n: float
    """Sum of the normal forces between the robot and the subjects, N."""
    itself: bool
    """True if the robot presses against itself."""
    torque_nm: float
    """Greatest torque of a motor of the arm, Nm; 0.0 in a world without an arm."""


def loads(world: OnMujoco, subjects: Iterable[str]) -> Loads:
    """Solve the contacts of a world's present state in a copy of it."""
    # A world on MuJoCo whose robot names no parts has robosuite's names.
    scratch = _scratch(world.model, world.robot if isinstance(world.robot, MujocoRobot) else PANDA)
    mujoco.mj_getState(world.model, world.data, scratch.state, _STATE)
    mujoco.mj_setState(world.model, scratch.data, scratch.state, _STATE)
    mujoco.mj_forward(world.model, scratch.data)
    of_goal = np.zeros(world.model.ngeom, bool)
    for name in subjects:
        of_goal[world.geoms(name)] = True
    force, surroundings, goal, itself = np.zeros(6), 0.0, 0.0, False
    for number, (one, other) in enumerate(scratch.data.contact.geom[: scratch.data.ncon].tolist()):
        if not (scratch.robot[one] or scratch.robot[other]):
            continue
        mujoco.mj_contactForce(world.model, scratch.data, number, force)
        if scratch.robot[one] and scratch.robot[other]:
            itself |= bool(force[0] > 0.0 and not (scratch.finger[one] and scratch.finger[other]))
        elif of_goal[one] or of_goal[other]:
            goal += float(force[0])
        else:
            surroundings += float(force[0])
    torques = np.abs(scratch.data.qfrc_actuator[scratch.motors])
    return Loads(surroundings, goal, itself, float(torques.max(initial=0.0)))


@dataclass(frozen=True)
class _Scratch:
    """A copy of a world to solve in, and the parts of its robot."""

    data: mujoco.MjData
    """Overwritten at every look."""
    state: NDArray[np.float64]
    """Buffer for the state that goes into it."""
    robot: NDArray[np.bool_]
    """(ngeom,) bool: geoms of arm and gripper."""
    finger: NDArray[np.bool_]
    """(ngeom,) bool: of them, those of the fingers."""
    motors: NDArray[np.intp]
    """(n,) degrees of freedom of the arm's joints; (0,) in a world without an arm."""


@lru_cache(maxsize=2)
def _scratch(model: mujoco.MjModel, robot: MujocoRobot) -> _Scratch:
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or "" for body in range(model.nbody)]
    # Not the mount, which does not move.
    owners = [None if name.startswith(f"{MOUNT}_") else robot.owner_of(name) for name in names]
    moving = np.array([owner is not None for owner in owners])
    finger = np.array(
        [owner == GRIPPER and "finger" in name for name, owner in zip(names, owners, strict=True)]
    )
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in robot.arm_joints]
    motors = np.array([int(model.jnt_dofadr[joint]) for joint in joints if joint >= 0], dtype=np.intp)
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    of = model.geom_bodyid
    return _Scratch(mujoco.MjData(model), state, moving[of], finger[of], motors)
