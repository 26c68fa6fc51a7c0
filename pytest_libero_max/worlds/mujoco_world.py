"""Base of every world on MuJoCo: poses, parking, snapshots, digests, images.

A subclass adds a robot: how one control step is played, which controller state MuJoCo does not hold,
where the grip site is, what proprioception says and when the task is solved.

Between calls ``mj_step1`` has always been done for the current state, so positions, contacts and
camera frames belong to it. A control step may therefore start with actuation and end with the next
``mj_step1`` (see :mod:`pytest_libero_max.worlds.stepping`).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, replace
from hashlib import blake2b
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import (
    SimulatorError,
    SubstrateError,
    did_you_mean,
)
from pytest_libero_max.worlds.base import WorldBase
from pytest_libero_max.worlds.contract import (
    Array,
    Entity,
    Image,
    ImageSize,
    OnMujoco,
    World,
    WorldState,
)
from pytest_libero_max.worlds.guard import ModelGuard
from pytest_libero_max.worlds.mujoco_scenery import MujocoScenery
from pytest_libero_max.worlds.rendering import context, gl
from pytest_libero_max.worlds.robot import PANDA, MujocoRobot
from pytest_libero_max.worlds.scene_digest import model_fields, value_digest

gl.prepare()  # MuJoCo reads the backend while it is imported

import mujoco  # noqa: E402

if TYPE_CHECKING:
    from pytest_libero_max.worlds.rendering.renderer import Renderer

HIDDEN_GROUP = 5
"""Geoms of this group are never drawn; parked objects are put into it."""

_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_WARNINGS = MappingProxyType(
    {
        "positions are no longer finite": mujoco.mjtWarning.mjWARN_BADQPOS,
        "velocities are no longer finite": mujoco.mjtWarning.mjWARN_BADQVEL,
        "accelerations are no longer finite": mujoco.mjtWarning.mjWARN_BADQACC,
        "controls are no longer finite": mujoco.mjtWarning.mjWARN_BADCTRL,
        "the inertia matrix is singular": mujoco.mjtWarning.mjWARN_INERTIA,
        "contacts were left out for lack of memory": mujoco.mjtWarning.mjWARN_CONTACTFULL,
        "constraints were left out for lack of memory": mujoco.mjtWarning.mjWARN_CNSTRFULL,
    }
)
"""Warnings after which MuJoCo only counts and carries on."""

FASTEST = 1e4
"""Largest plausible speed of a joint, m/s or rad/s; a faster one means that the integration has failed."""

_UNIT_TOLERANCE = 1e-3


class MujocoWorld(WorldBase, MujocoScenery):
    """The part of :class:`pytest_libero_max.worlds.contract.World` that does not depend on the robot.

    Args:
        scene: Stable key of the scene, for example ``embedded/libero_spatial/0``.
        model: The compiled model, already complete; a reset restores its current values.
        entities: Entities that a case can name. Objects need exactly one free joint on their root body.

    Attributes:
        open_task: Returns a world of another task; set by the substrate that built this one.
    """

    def __init__(
        self,
        scene: str,
        language: str,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        entities: Mapping[str, Entity],
        robot: MujocoRobot = PANDA,
    ) -> None:
        super().__init__(scene, language, entities, robot)
        self._model = model
        self._data = data
        self._renderer: Renderer | None = None
        self._guard: ModelGuard | None = None
        self.open_task: Callable[[str, int], OnMujoco] | None = None
        # Made once: MuJoCo makes a new array of the same memory whenever it is asked for one.
        self._alterable: dict[str, NDArray[Any]] = {
            field: getattr(model, field) for field in self.alterable_fields
        }
        self._hashed = [array.reshape(-1).data for array in self._alterable.values()]
        self._compiled = {field: array.copy() for field, array in self._alterable.items()}
        self._scene_fields: dict[str, str] = {}  # filled when they are asked for
        self._body = {name: self._body_id(entity) for name, entity in self._entities.items()}
        self._joint = {
            name: self._free_joint(name) for name, entity in self._entities.items() if entity.kind == "object"
        }
        self._owner = self._geom_owners(robot)
        self._finger = self._geom_fingers(robot.finger_joints)

    # What a subclass adds.

    @abstractmethod
    def _initial_qpos(self, init: int) -> Array:
        """Joint positions of initial state ``init``; raises SubstrateError where there is none."""

    @abstractmethod
    def _reset_controller(self) -> None:
        """Put the controller into its state at the start of an episode; kinematics are up to date."""

    @abstractmethod
    def _controller_state(self) -> Array:
        """Return a copy of the controller and gripper state that MuJoCo does not hold, float64."""

    @abstractmethod
    def _set_controller_state(self, state: Array) -> None:
        """Write back what :meth:`_controller_state` returned."""

    @abstractmethod
    def _control_step(self, action: Array) -> bool:
        """Play one control step of a float64 action, ending with :meth:`_settle` or its equivalent.

        ``_control`` is the meaning of the action.

        Returns:
            True if it has checked that MuJoCo warns of nothing and no joint is faster than :data:`FASTEST`;
            False where it has not checked.
        """

    @abstractmethod
    def end_effector(self) -> Array: ...

    @abstractmethod
    def succeeded(self) -> bool: ...

    @abstractmethod
    def _decided(self) -> Mapping[str, Any]:
        """Return the parts of a scene that are decided and not compiled, by name: goal, gains of the control.

        Values are arrays or JSON values, tuples among them.
        """

    def _after_step(self) -> None:
        """Follow-up of a step or a reset that writes alterable fields, such as a burner's glow."""

    # For a substrate.

    @staticmethod
    def versions(images: bool = False) -> dict[str, str]:
        """Return the part of a fingerprint that substrates on MuJoCo share: its version, what draws images.

        Args:
            images: See :meth:`.Substrate.fingerprint`.
        """
        return {"mujoco": mujoco.__version__, **context.fingerprint(images)}

    # The contract.

    @property
    def model(self) -> mujoco.MjModel:
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        return self._data

    def reset(self, init: int) -> None:
        qpos = self._initial_qpos(init)
        self._write_model(self._compiled)
        mujoco.mj_resetData(self._model, self._data)
        self._write_start(qpos)
        self._begin_episode()
        self._settle()
        self._reset_controller()
        self._after_step()
        if self._guard is None:  # the first reset of a scene ends its construction
            self._guard = ModelGuard(self._model, self.alterable_fields)

    def step(self, action: Sequence[float] | Array) -> None:
        sound = self._control_step(self._checked_action(action))
        self._steps += 1
        if not sound:
            self._require_sound()
        self._after_step()

    def _require_sound(self) -> None:
        """Check that MuJoCo has not met with numerical trouble, and that nothing is impossibly fast."""
        counts = self._data.warning.number
        for what, warning in _WARNINGS.items():
            if counts[warning]:
                raise self._numerical_trouble(what)
        fastest = np.abs(self._data.qvel).max(initial=0.0)
        if not fastest <= FASTEST:
            raise self._numerical_trouble(f"a joint moves at {fastest:.3g} m/s or rad/s")

    def _numerical_trouble(self, what: str) -> SimulatorError:
        return SimulatorError(
            f"{self._scene}: {what} after control step {self._steps}. The episode is lost; reset the world."
        )

    def visible_pixels(self, camera: str, size: int = 256) -> dict[str, int]:
        owners = self._owner[self._segmented(camera, size)]
        count = np.bincount(owners[owners >= 0], minlength=len(self._owner_names))
        return {name: int(number) for name, number in zip(self._entities, count, strict=False) if number}

    def snapshot(self) -> WorldState:
        return WorldState(
            scene=self._scene,
            physics=_frozen(self._physics()),
            model={field: _frozen(array.copy()) for field, array in self._alterable.items()},
            controller=_frozen(self._controller_state()),
            steps=self._steps,
            filters=self._filters,
            parked=tuple(self._parked.items()),
            assigned=self._assigned,
            control=self._control,
        )

    def restore(self, state: WorldState) -> None:
        if state.scene != self._scene:
            raise SubstrateError(
                f"A state of scene {state.scene!r} cannot be restored into {self._scene!r}: states belong to "
                "the scene they were taken from."
            )
        self._write_model(state.model)
        mujoco.mj_resetData(self._model, self._data)  # warnings and left-overs outside the state go
        mujoco.mj_setState(self._model, self._data, state.physics.copy(), _STATE)  # it wants a writable array
        self._set_controller_state(state.controller)
        self._steps, self._filters, self._parked = state.steps, state.filters, dict(state.parked)
        self._assigned, self._control = state.assigned, state.control
        self._settle()

    def digest(self) -> bytes:
        fingerprint = blake2b(digest_size=32)
        fingerprint.update(self._physics().data)
        for values in self._hashed:
            fingerprint.update(values)
        fingerprint.update(self._controller_state().data)
        fingerprint.update(self._memory().encode())
        # Nothing for delta, the first control there was: digests of published runs stay what they were.
        if self._control != "delta":
            fingerprint.update(self._control.encode())
        return fingerprint.digest()

    def scene_fields(self) -> Mapping[str, str]:
        if not self._scene_fields:
            self._scene_fields |= model_fields(self._model, self._compiled)
            entities = {name: astuple(entity) for name, entity in self._entities.items()}
            decided = {"language": self._language, "entities": entities, **self._decided()}
            self._scene_fields |= {name: value_digest(value) for name, value in decided.items()}
        return MappingProxyType(self._scene_fields)

    def posture(self) -> NDArray[np.float32]:
        positions: NDArray[np.float32] = self._data.qpos.astype(np.float32)
        return positions

    def posed(self, state: WorldState, posture: NDArray[np.float32], steps: int) -> WorldState:
        physics = state.physics.copy()
        physics[1 : 1 + len(posture)] = posture  # the time is before them
        return replace(state, physics=physics, steps=steps)

    def take_back_writes(self) -> tuple[str, ...]:
        return () if self._guard is None else self._guard.take_back()

    @property
    def spoiled(self) -> bool:
        """True if a write could not be undone: the substrate then builds the scene anew."""
        return self._guard is not None and self._guard.spoiled

    def position(self, entity: str) -> Array:
        return self.pose(entity)[0]

    def pose(self, entity: str) -> tuple[Array, Array]:
        name = self._known(entity)
        if name in self._joint:
            address = self._qpos_address(name)
            values = self._data.qpos[address : address + 7]
            return values[:3].copy(), values[3:].copy()
        body = self._body[name]
        return self._model.body_pos[body].copy(), self._model.body_quat[body].copy()

    def contacts(self, entity: str) -> tuple[str, ...]:
        number = self._owner_names.index(self._known(entity))
        pairs = self._owner[self._data.contact.geom[: self._data.ncon]]
        touching = {int(other) for pair in pairs if number in pair for other in pair}
        return tuple(sorted(self._owner_names[other] for other in touching - {number, -1}))

    def fingers_on(self, entity: str) -> int:
        number = self._owner_names.index(self._known(entity))
        pairs = self._data.contact.geom[: self._data.ncon]
        fingers = self._finger[pairs[:, ::-1]][self._owner[pairs] == number]
        return len(set(fingers.tolist()) - {-1})

    def geoms(self, entity: str) -> NDArray[np.intp]:
        return np.flatnonzero(self._owner == self._owner_names.index(self._known(entity)))

    def place(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        name = self._known(entity)
        if name in self._parked:
            raise SubstrateError(f"{name!r} is parked, so it cannot be placed: unpark it there instead.")
        self._write_pose(name, _position(position), None if quaternion is None else _quaternion(quaternion))
        self._settle()
        self._after_alteration()

    def push(self, entity: str, velocity_m_s: Sequence[float] | Array) -> None:
        name = self._free(entity)
        if name in self._parked:
            raise SubstrateError(f"{name!r} is parked, so it cannot be pushed: unpark it before.")
        first = self._dofs(name).start
        self._data.qvel[first : first + 3] += _three_numbers("velocity_m_s", velocity_m_s, "m/s")
        self._settle()
        self._after_alteration()

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        name = self._free(entity)
        if name in self._parked:
            raise SubstrateError(f"{name!r} is already parked.")
        where = _position(position)
        at, orientation = self.pose(name)
        self._parked[name] = (*at.tolist(), *orientation.tolist())
        self._write_pose(name, where, None)
        geoms = self.geoms(name)
        self._model.geom_contype[geoms] = 0
        self._model.geom_conaffinity[geoms] = 0
        self._model.geom_group[geoms] = HIDDEN_GROUP
        self._settle()
        # At rest the bias of a free body is its weight and depends on its own pose alone: the applied
        # force cancels it to the last bit, so its acceleration is zero and it stays where it is.
        dofs = self._dofs(name)
        self._data.qfrc_applied[dofs] = self._data.qfrc_bias[dofs]
        self._after_alteration()

    def unpark(
        self,
        entity: str,
        position: Sequence[float] | Array,
        quaternion: Sequence[float] | Array | None = None,
    ) -> None:
        name = self._free(entity)
        orientation = self.parked_pose(name)[1] if quaternion is None else _quaternion(quaternion)
        where = _position(position)
        if name not in self._parked:
            raise SubstrateError(f"{name!r} is not parked. {did_you_mean(name, self._parked)}")
        del self._parked[name]
        geoms = self.geoms(name)
        for field in ("geom_contype", "geom_conaffinity", "geom_group"):
            self._alterable[field][geoms] = self._compiled[field][geoms]
        self._data.qfrc_applied[self._dofs(name)] = 0.0
        self._write_pose(name, where, orientation)
        self._settle()
        self._after_alteration()

    def other_task(self, suite: str, index: int) -> World:
        if self.open_task is None:
            return super().other_task(suite, index)
        other = self.open_task(suite, index)
        if other.model is self._model:
            raise SubstrateError(f"task {index} of {suite} is the one of this scene. Name another task.")
        return other

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    # Inside.

    def _write_start(self, qpos: Array) -> None:
        """Write the joint positions of an initial state into data that have just been reset."""
        self._data.qpos[:] = qpos
        # The first step would do it, and what is parked before that would move by a rounding error.
        mujoco.mj_normalizeQuat(self._model, self._data.qpos)

    def _settle(self) -> None:
        """Bring derived data up to date with the current state, which stays as it is."""
        mujoco.mj_step1(self._model, self._data)

    def _physics(self) -> Array:
        state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, state, _STATE)
        return state

    def _write_model(self, fields: Mapping[str, NDArray[Any]]) -> None:
        for field, array in self._alterable.items():
            array[:] = fields[field]

    def _write_pose(self, name: str, position: Array, quaternion: Array | None) -> None:
        if name not in self._joint:
            body = self._body[name]
            self._model.body_pos[body] = position
            if quaternion is not None:
                self._model.body_quat[body] = quaternion
            return
        address, dofs = self._qpos_address(name), self._dofs(name)
        self._data.qpos[address : address + 3] = position
        if quaternion is not None:
            self._data.qpos[address + 3 : address + 7] = quaternion
        self._data.qvel[dofs] = 0.0
        self._data.qacc_warmstart[dofs] = 0.0  # the solver must not start from forces felt elsewhere

    def _drawn(self, camera: str, size: ImageSize) -> Image:
        if self._renderer is None:
            self._renderer = self._new_renderer()
        return self._renderer.render(camera, size)

    def _segmented(self, camera: str, size: int) -> NDArray[np.intp]:
        """Return the geoms that are drawn, one number for each pixel that shows one."""
        if self._renderer is None:
            self._renderer = self._new_renderer()
        shown = self._renderer.segment(camera, size)
        return shown[shown >= 0]

    def _new_renderer(self) -> Renderer:
        from pytest_libero_max.worlds.rendering.renderer import Renderer

        return Renderer(self._model, self._data)

    def _free(self, entity: str) -> str:
        if self._known(entity) not in self._joint:
            kind = self._entities[entity].kind
            raise SubstrateError(
                f"{entity!r} is a {kind}: only objects have a free joint and can be parked or pushed."
            )
        return entity

    def _body_id(self, entity: Entity) -> int:
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, entity.body)
        if body < 0:
            raise SubstrateError(f"{self._scene} has no body {entity.body!r} for entity {entity.name!r}.")
        return int(body)

    def _free_joint(self, name: str) -> int:
        body = self._body[name]
        joint = int(self._model.body_jntadr[body])
        if joint < 0 or self._model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
            raise SubstrateError(f"{self._scene}: object {name!r} has no free joint on body {body}.")
        return joint

    def _qpos_address(self, name: str) -> int:
        return int(self._model.jnt_qposadr[self._joint[name]])

    def _dofs(self, name: str) -> slice:
        first = int(self._model.jnt_dofadr[self._joint[name]])
        return slice(first, first + 6)

    def _geom_owners(self, robot: MujocoRobot) -> NDArray[np.int64]:
        """For each geom the index into ``_owner_names`` of what it belongs to, or -1.

        A geom belongs to the nearest of its body's ancestors that is an entity's root, unless its body
        is one of the robot's. What hangs from the world body itself belongs to an entity of that body.
        """
        self._owner_names = [*self._entities, *sorted(set(robot.owners.values()))]
        roots = {self._body[name]: number for number, name in enumerate(self._entities)}
        owner_of_body = np.full(self._model.nbody, -1)
        for body in range(self._model.nbody):
            label = mujoco.mj_id2name(self._model, mujoco.mjtObj.mjOBJ_BODY, body) or ""
            owner = robot.owner_of(label)
            parent = int(self._model.body_parentid[body])
            if owner is not None:
                owner_of_body[body] = self._owner_names.index(owner)
            elif body in roots:
                owner_of_body[body] = roots[body]
            elif parent != 0:
                owner_of_body[body] = owner_of_body[parent]
        owners: NDArray[np.int64] = owner_of_body[self._model.geom_bodyid]
        return owners

    def _geom_fingers(self, joints: Sequence[str]) -> NDArray[np.int64]:
        """Return for each geom the number of the finger that it is part of, or -1."""
        finger_of_body = np.full(self._model.nbody, -1)
        moved = {int(self._model.joint(name).bodyid[0]): number for number, name in enumerate(joints)}
        for body in range(1, self._model.nbody):
            parent = finger_of_body[int(self._model.body_parentid[body])]
            finger_of_body[body] = moved.get(body, parent)
        fingers: NDArray[np.int64] = finger_of_body[self._model.geom_bodyid]
        return fingers


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array


def _position(values: Sequence[float] | Array) -> Array:
    return _three_numbers("position", values, "metres")


def _three_numbers(what: str, values: Sequence[float] | Array, unit: str) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise SubstrateError(f"{what}={values!r}: three finite numbers in {unit} are needed.")
    return array


def _quaternion(values: Sequence[float] | Array) -> Array:
    """Return a unit quaternion, normalised as MuJoCo does: one that a simulation produced keeps its bits."""
    quaternion = np.array(values, dtype=np.float64)
    length = float(np.linalg.norm(quaternion)) if quaternion.shape == (4,) else np.nan
    if not abs(length - 1.0) <= _UNIT_TOLERANCE:
        raise SubstrateError(f"quaternion={values!r}: four numbers w, x, y, z of unit length are needed.")
    mujoco.mju_normalize4(quaternion)
    return quaternion
