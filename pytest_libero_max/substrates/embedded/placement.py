"""Initial states of every task: drawn in LIBERO's regions, settled by the simulator, rounded.

Ten are the benchmark's. The other forty are drawn in the same way, for training data, and no frozen case
begins from one of them.

The draws come straight from SHA-256 of (suite, task, initial state, attempt, quantity), so no generator's
stream and no order of calls enters. What the simulator settles is rounded to a micrometre and microradian,
far above the last bits in which two processors may differ: the same index gives the same bytes everywhere.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from statistics import NormalDist
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from pytest_libero_max.benchmark.identity import FROZEN_STATES, TRAINING_STATES
from pytest_libero_max.errors import SimulatorError, SubstrateError
from pytest_libero_max.substrates.embedded.arenas import ARENAS
from pytest_libero_max.substrates.embedded.objects import category
from pytest_libero_max.substrates.embedded.predicates import touching
from pytest_libero_max.substrates.embedded.scene import Scene, joint_state, joints_of, resolve
from pytest_libero_max.tasks.libero_tasks import category_of
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.privileged import Fact
from pytest_libero_max.worlds.robot import PANDA

if TYPE_CHECKING:
    import mujoco

# LIBERO's initial states scatter each arm joint with a deviation of 0.02 rad, never by more than 0.08.
_ARM_SPREAD, _ARM_LIMIT = 0.02, 0.08
# Where things are put relative to the middle of a fixture's region, along the fixture's axes, m: (x_min,
# x_max), (y_min, y_max). In a drawer they stand towards its front, clear of the cabinet above.
_SITE_SPREAD = MappingProxyType(
    {
        "top_side": ((-0.03, 0.03), (-0.02, 0.02)),
        "cook_region": ((-0.01, 0.01), (-0.01, 0.01)),
        "top_region": ((-0.01, 0.01), (-0.020, -0.016)),
    }
)
_DROP = 0.0008
_CLEARANCE = 0.002
_ATTEMPTS = 200
_SEARCH_ABOVE, _SEARCH_STEP, _BISECTIONS = 0.2, 0.004, 10
_SETTLE_STEPS = 3000
_STILL_STEPS = 50
_STILL_SPEED = 2e-4
_DIGITS = 6
# Two stiff bodies rest on each other with less than the rounding between them; pressed together by this
# much they still touch afterwards, m.
_PRESS = 2e-6


def initial_state(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, init: int) -> Array:
    """Return an initial state of a scene, at rest, or raise SubstrateError or SimulatorError.

    Args:
        scene: The scene that ``model`` was compiled from.
        data: Scratch space of that model; whatever it holds is overwritten.
        init: Of :data:`.FROZEN_STATES` or :data:`.TRAINING_STATES`.

    Returns:
        (nq,) joint positions; every velocity is 0.
    """
    if init not in FROZEN_STATES and init not in TRAINING_STATES:
        raise SubstrateError.seen(
            "init",
            init,
            f" is not an initial state of {scene.key}: use 0 to {FROZEN_STATES[-1]}, or for training data "
            f"{TRAINING_STATES[0]} to {TRAINING_STATES[-1]}.",
        )
    trouble = "nothing was drawn"
    for attempt in range(_ATTEMPTS):
        draw = _Draw(f"{scene.key}/{init}/{attempt}")
        _lay_out(scene, model, data, draw)
        clash = _clash(scene, model, data)
        if clash:
            trouble = clash
            continue
        if not _settle(model, data):
            trouble = "the objects did not come to rest"
            continue
        qpos = _rounded(scene, model, data.qpos)
        trouble = _defect(scene, model, data, qpos)
        if not trouble:
            return qpos
    raise SimulatorError(
        f"initial state {init} of {scene.key} could not be laid out in {_ATTEMPTS} draws: {trouble}."
    )


class _Draw:
    """Uniform numbers by name, each from its own hash."""

    def __init__(self, seed: str) -> None:
        self._seed = seed

    def uniform(self, name: str, low: float, high: float) -> float:
        digest = hashlib.sha256(f"{self._seed}/{name}".encode()).digest()
        # 53 bits, as many as a double holds; the half keeps the share off 0, where a normal is infinite.
        return low + (high - low) * ((int.from_bytes(digest[:8], "big") >> 11) + 0.5) / 2**53

    def normal(self, name: str, spread: float, limit: float) -> float:
        value = NormalDist(0.0, spread).inv_cdf(self.uniform(name, 0.0, 1.0))
        return min(max(value, -limit), limit)


def _lay_out(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, draw: _Draw) -> None:
    """Put everything into its place, a hair above its support."""
    import mujoco

    mujoco.mj_resetData(model, data)
    known = {model.joint(n).name for n in range(model.njnt)}
    for name, middle in zip(PANDA.arm_joints, PANDA.home_rad, strict=True):
        if name in known:
            data.joint(name).qpos[0] = round(middle + draw.normal(name, _ARM_SPREAD, _ARM_LIMIT), _DIGITS)
    for name, position in PANDA.finger_start.items():
        if name in known:
            data.joint(name).qpos[0] = position
    for fact in scene.task.start:
        if fact.place is None:
            span = joint_state(fact, scene.entities, scene.regions).start
            assert span is not None, f"{scene.key} starts in a state that has no range: {fact}"
            for joint in joints_of(fact.subject, scene.entities, scene.regions):
                data.joint(joint).qpos[0] = draw.uniform(joint, *span)
    mujoco.mj_kinematics(model, data)
    for fact in _supports_first(scene):
        x, y, height = _spot(scene, model, data, fact, draw)
        kind = category(category_of(fact.subject))
        joint = data.joint(f"{fact.subject}_joint0")
        joint.qpos[:3] = x, y, height + kind.origin_height + _DROP
        joint.qpos[3:] = kind.upright
        if kind.turn is not None:
            angle = draw.uniform(f"{fact.subject}/turn", *kind.turn)
            joint.qpos[3:] = rotations.multiply(rotations.about((0, 0, 1), angle), kind.upright)
        mujoco.mj_kinematics(model, data)
    mujoco.mj_forward(model, data)


def _supports_first(scene: Scene) -> Iterator[Fact]:
    """Yield the objects' places, each after the object that it rests on."""
    waiting = [fact for fact in scene.task.start if fact.subject in scene.task.objects]
    placed: set[str | None] = {name for name, entity in scene.entities.items() if entity.kind != "object"}
    while waiting:
        fact = next(fact for fact in waiting if scene.entities[fact.subject].support in placed)
        waiting.remove(fact)
        placed.add(fact.subject)
        yield fact


def _spot(
    scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, fact: Fact, draw: _Draw
) -> tuple[float, float, float]:
    """Place for an object: x, y and the height of its support."""
    place = fact.place or ""
    if place in scene.task.places:
        arena = ARENAS[scene.task.arena]
        margin = category(category_of(fact.subject)).spread_margin if arena.spares_edges else 0.0
        low_x, low_y, high_x, high_y = scene.task.places[place].box
        # LIBERO shrinks a region by the object's nominal radius; where the radius is larger, the interval
        # turns over and has the difference as its half width.
        reach_x, reach_y = abs((high_x - low_x) / 2 - margin), abs((high_y - low_y) / 2 - margin)
        x = (low_x + high_x) / 2 + draw.uniform(f"{fact.subject}/x", -reach_x, reach_x)
        y = (low_y + high_y) / 2 + draw.uniform(f"{fact.subject}/y", -reach_y, reach_y)
        return x, y, arena.top_z
    support = scene.entities[scene.entities[fact.subject].support or ""]
    if place in scene.regions:
        site = data.site(place)
        reach = next(reach for name, reach in _SITE_SPREAD.items() if place.endswith(name))
        offset = [
            draw.uniform(f"{fact.subject}/{axis}", *span) for axis, span in zip("xy", reach, strict=True)
        ]
        frame = data.body(support.body).xmat.reshape(3, 3)
        x, y, _ = site.xpos + frame @ np.array([*offset, 0.0])
    else:
        x, y, _ = data.body(support.body).xpos
    return (
        float(x),
        float(y),
        _height_under(scene, model, data, fact.subject, support.body, float(x), float(y)),
    )


def _height_under(
    scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, instance: str, support: str, x: float, y: float
) -> float:
    """Height of the lowest point of an object at (x, y) where it meets its support, m."""
    import mujoco

    kind = category(category_of(instance))
    joint = data.joint(f"{instance}_joint0")

    def meets(height: float) -> bool:
        joint.qpos[:3] = x, y, height + kind.origin_height
        joint.qpos[3:] = kind.upright
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        return touching(model, data, scene.entities[instance].body, support)

    fact = next(fact for fact in scene.task.start if fact.subject == instance and fact.place)
    if fact.predicate == "in":
        free = float(data.site(fact.place).xpos[2])
    else:
        free = float(data.geom_xpos[_geoms(model, support)][:, 2].max()) + _SEARCH_ABOVE
    while not meets(free - _SEARCH_STEP):
        free -= _SEARCH_STEP
    blocked = free - _SEARCH_STEP
    for _ in range(_BISECTIONS):
        middle = (free + blocked) / 2
        free, blocked = (free, middle) if meets(middle) else (middle, blocked)
    return free


def _geoms(model: mujoco.MjModel, root: str) -> list[int]:
    """Colliding geoms under a root body."""
    inside = model.body_rootid[model.geom_bodyid] == model.body(root).id
    return [int(g) for g in np.flatnonzero(inside & (model.geom_contype != 0))]


def _clash(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData) -> str:
    """Two things that are closer than they should be, in words; empty if there are none."""
    import mujoco

    margin = model.geom_margin.copy()
    try:
        model.geom_margin[:] = _CLEARANCE
        mujoco.mj_collision(model, data)
        near = _touching_entities(scene, model, data)
    finally:
        model.geom_margin[:] = margin
    for first, second in sorted(near):
        one, other = scene.entities[first], scene.entities[second]
        if "object" in (one.kind, other.kind) and second != one.support and first != other.support:
            return f"{first} is too close to {second}"
    return ""


def _touching_entities(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData) -> set[tuple[str, str]]:
    """Pairs of entities in contact, in both orders; contacts with the robot are left out."""
    owner = {model.body(entity.body).id: name for name, entity in scene.entities.items()}
    pairs = set()
    for contact in data.contact.geom[: data.ncon]:
        bodies = model.geom_bodyid[contact]
        # The floor of the table's room belongs to the world itself and has no entity.
        names = [owner.get(int(model.body_rootid[body])) for body in bodies]
        if names[0] is not None and names[1] is not None and names[0] != names[1]:
            pairs |= {(names[0], names[1]), (names[1], names[0])}
    return pairs


def _settle(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Simulate until nothing moves, the robot held in place; return True if that happened."""
    import mujoco

    held_q, held_v = _robot_addresses(model)
    pose = data.qpos[held_q].copy()
    still = 0
    for _ in range(_SETTLE_STEPS):
        mujoco.mj_step(model, data)
        data.qpos[held_q] = pose
        data.qvel[held_v] = 0.0
        still = still + 1 if np.abs(data.qvel).max() < _STILL_SPEED else 0
        if still >= _STILL_STEPS:
            return True
    return False


def _robot_addresses(model: mujoco.MjModel) -> tuple[list[int], list[int]]:
    joints = [model.joint(n) for n in range(model.njnt)]
    held = [joint for joint in joints if joint.name in (*PANDA.arm_joints, *PANDA.finger_joints)]
    return [int(joint.qposadr[0]) for joint in held], [int(joint.dofadr[0]) for joint in held]


def _rounded(scene: Scene, model: mujoco.MjModel, qpos: Array) -> Array:
    """Round to micrometres and microradians; quaternions are made unit length first."""
    result = qpos.copy()
    for name in scene.task.objects:
        start = int(model.joint(f"{name}_joint0").qposadr[0])
        result[start + 3 : start + 7] /= np.linalg.norm(result[start + 3 : start + 7])
    result = np.round(result, _DIGITS)
    for name in scene.task.objects:
        if scene.entities[scene.entities[name].support or ""].kind != "surface":
            result[int(model.joint(f"{name}_joint0").qposadr[0]) + 2] -= _PRESS
    # Rounding again leaves no trace of the subtraction; adding zero turns -0.0 into 0.0, which has other
    # bytes.
    return np.round(result, _DIGITS) + 0.0


def _defect(scene: Scene, model: mujoco.MjModel, data: mujoco.MjData, qpos: Array) -> str:
    """Return the defect of a settled state, in words; empty if it has none."""
    import mujoco

    if not np.isfinite(qpos).all():
        return "the state is not finite"
    mujoco.mj_resetData(model, data)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    touching_now = _touching_entities(scene, model, data)
    for name in scene.task.objects:
        entity = scene.entities[name]
        others = {other for mine, other in touching_now if mine == name}
        above = {other for other in scene.task.objects if scene.entities[other].support == name}
        if entity.support not in others:
            return f"{name} does not rest on {entity.support}"
        if others - above - {entity.support}:
            return f"{name} touches {min(others - above - {entity.support})}"
    for fact in scene.task.start:
        if fact.subject in scene.task.fixtures or fact.place in scene.task.places:
            continue  # put there by construction; LIBERO's predicate asks for tiny regions, not for rest
        if not resolve(fact, scene.entities, scene.regions).holds(model, data):
            return f"{fact.subject} is not {fact.predicate} {fact.place or ''}".rstrip()
    return ""
