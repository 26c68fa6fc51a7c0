"""A task of Meta-World as a world: the package's own environment, stepped, copied and altered.

The environment decides what an action does, what is observed and when the task is solved. A snapshot holds
MuJoCo's integration state, with the mocap body and the solver's warm start, and what the environment keeps
beside it. The package calls ``mj_forward`` after each step, and so does settling: it alters no part of that
state. (In MuJoCo 3.3.0 it wrote the warm start: a restored world left the other one in its last bits.)
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.lab.metaworld.robot import MT50, SAWYER
from pytest_libero_max.lab.metaworld.scene import build, entities_of, numeric_fields, write_fields
from pytest_libero_max.lab.metaworld.tasks import Task, Thing
from pytest_libero_max.worlds.contract import Array, Control, Entity, WorldState
from pytest_libero_max.worlds.mujoco_scenery import ALTERABLE
from pytest_libero_max.worlds.mujoco_world import MujocoWorld
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.rendering.renderer import Renderer

gl.prepare()

import mujoco  # noqa: E402

DRAWN_GROUPS = (0, 1, 2)
"""Geom groups in an image, as MuJoCo draws them unless it is told otherwise."""

_OPEN_M = (0.05, -0.05)  # from the middle to the fingers, whose joints count from there inwards
_FIELD = "environment."
_FRAME = slice(18, 36)  # of an observation: the frame before


class MetaworldWorld(MujocoWorld):
    """One of the fifty tasks, with some spare objects compiled into its scene.

    Initial state ``i`` is what ``env.seed(i)`` and ``env.reset()`` lead to in an environment that has just
    been built, computed once.
    """

    alterable_fields = (*ALTERABLE, "site_pos")

    def __init__(self, task: Task, spares: Collection[str] = ()) -> None:
        self._task, self._env = task, build(task, spares)
        self._success = False
        self._home = {name: np.zeros(3) for name in _names_of_places(task)}
        """Places of the movable things at the start of the episode, and of what comes along with them, m."""
        model = self._env.model
        scene = "+".join([f"{MT50.benchmark}/{task.name}", *sorted(spares)])
        super().__init__(
            scene, task.instruction, model, self._env.data, entities_of(model, task, spares), SAWYER
        )
        self._arm = [int(model.joint(name).qposadr[0]) for name in SAWYER.arm_joints]
        self._arm_dofs = [int(model.joint(name).dofadr[0]) for name in SAWYER.arm_joints]
        self._fingers = [int(model.joint(name).qposadr[0]) for name in SAWYER.finger_joints]
        self._starts: dict[int, WorldState] = {}
        self._built = super().snapshot()
        self._built_fields = numeric_fields(self._env)
        self.reset(0)

    @property
    def task(self) -> str:
        """Meta-World's name of the task."""
        return self._task.name

    def task_observation(self) -> Array:
        """Return the 39 numbers that the task observes, for policies that are privileged."""
        observation: Array = self._env._last_stable_obs.copy()
        return observation

    # Episodes.

    def _initial_qpos(self, init: int) -> Array:
        if not 0 <= init < MT50.states:
            raise SubstrateError.seen(
                "init", init, f": {self._scene} has initial states 0 to {MT50.states - 1}."
            )
        if init not in self._starts:
            self._starts[init] = self._start(init)
        self._beginning = self._starts[init]
        return self._beginning.physics[1 : 1 + self._model.nq]  # the time is before them

    def _reset_controller(self) -> None:
        self.restore(self._beginning)  # an initial state is more than positions

    def _start(self, init: int) -> WorldState:
        super().restore(self._built)
        write_fields(self._env, self._built_fields)
        self._env.seed(init)
        observation, _ = self._env.reset()
        self._begin_episode()
        self._settle()
        self._env._last_stable_obs = self._bounded(observation)
        self._home = self._places()
        self._after_alteration()
        return self.snapshot()

    def _control_step(self, action: Array) -> bool:
        env, data = self._env, self._data
        env.set_xyz_action(action[:3])
        data.ctrl[:] = (action[3], -action[3])
        mujoco.mj_step(self._model, data, nstep=env.frame_skip)
        env.curr_path_length += 1
        self._settle()
        env._last_stable_obs = self._bounded(env._get_obs())
        self._success = self._evaluated(action)
        return False

    def _bounded(self, observation: Array) -> Array:
        bounds = self._env.sawyer_observation_space
        bounded: Array = np.clip(observation, bounds.low, bounds.high)
        return bounded

    def _evaluated(self, action: Array) -> bool:
        _, info = self._env.evaluate_state(self._env._last_stable_obs, action)
        return bool(info["success"])

    def _settle(self) -> None:
        mujoco.mj_forward(self._model, self._data)

    def _after_alteration(self) -> None:
        """Observe and judge the altered state, without counting it as a step."""
        env = self._env
        self._settle()  # forces that parking has added
        env._prev_obs = env._last_stable_obs[_FRAME].copy()
        env._last_stable_obs = self._bounded(env._get_obs())
        kept = numeric_fields(env)
        self._success = self._evaluated(np.array(self._robot.noop))
        write_fields(env, kept)

    def set_control(self, control: Control) -> None:
        if control == "absolute":
            raise SubstrateError.seen(
                "control", control, f" is not possible: {self._robot.name} takes movements."
            )
        super().set_control(control)

    def succeeded(self) -> bool:
        return self._success

    # States.

    def snapshot(self) -> WorldState:
        state = super().snapshot()
        fields = {f"{_FIELD}{name}": value for name, value in numeric_fields(self._env).items()}
        for value in fields.values():
            value.flags.writeable = False
        return replace(state, model={**state.model, **fields})

    def restore(self, state: WorldState) -> None:
        super().restore(state)
        names = (name for name in state.model if name.startswith(_FIELD))
        write_fields(self._env, {name.removeprefix(_FIELD): state.model[name] for name in names})

    def _memory(self) -> str:
        fields = numeric_fields(self._env).items()
        return super()._memory() + repr([(name, value.tobytes()) for name, value in fields])

    def _controller_state(self) -> Array:
        return np.concatenate([[float(self._success)], *self._home.values()])

    def _set_controller_state(self, state: Array) -> None:
        self._success = bool(state[0])
        self._home = dict(zip(self._home, state[1:].reshape(-1, 3).copy(), strict=True))

    def _decided(self) -> Mapping[str, Any]:
        env = self._env
        bounds = [env.mocap_low.tolist(), env.mocap_high.tolist(), env.action_scale, env.frame_skip]
        return {"task": self._task.name, "control": bounds}

    # What is where.

    def end_effector(self) -> Array:
        position: Array = self._env.tcp_center.copy()
        return position

    def _proprioception(self) -> dict[str, Array]:
        data = self._data
        values = (
            self._env._last_stable_obs[:4].copy(),
            np.roll(data.body(SAWYER.hand_body).xquat, -1),
            data.qpos[self._arm],
            data.qvel[self._arm_dofs],
            np.subtract(_OPEN_M, data.qpos[self._fingers]),
        )
        return dict(zip(self._robot.state, values, strict=True))

    def pose(self, entity: str) -> tuple[Array, Array]:
        part, thing = self._task.part, self._task.things.get(entity)
        if part is not None and entity == part.name:
            return self._env._last_stable_obs[4:7].copy(), np.array((1.0, 0.0, 0.0, 0.0))
        if thing is not None and thing.site:
            site = self._model.site(thing.site)
            return site.pos.copy(), site.quat.copy()
        return super().pose(entity)

    def _write_pose(self, name: str, position: Array, quaternion: Array | None) -> None:
        part, thing = self._task.part, self._task.things.get(name)
        if part is not None and name == part.name:
            raise SubstrateError(f"{name!r} is a part of {self._task.target!r}: move that.")
        if thing is None or not thing.site:
            super()._write_pose(name, position, quaternion)
        else:
            self._model.site(thing.site).pos = position
        if name in self._home:
            way = position - self._home[name]
            for field in thing.fields if thing is not None else ():
                setattr(self._env, field, self._home[f"{name}.{field}"] + way)
            for mark in thing.marks if thing is not None else ():
                self._model.site(mark).pos = self._home[f"{name}.{mark}"] + way

    def _places(self) -> dict[str, Array]:
        """Return where the things are that something comes along with, and where that is."""
        places = []
        for thing in _leading(self._task):
            places.append(self.position(thing.name))
            places += [np.array(getattr(self._env, field), dtype=float) for field in thing.fields]
            places += [self._model.site(mark).pos.copy() for mark in thing.marks]
        return dict(zip(self._home, places, strict=True))

    def visible_pixels(self, camera: str, size: int = 256) -> dict[str, int]:
        pixels = super().visible_pixels(camera, size)
        marks = [thing for thing in self._task.things.values() if thing.site]
        if marks:
            assert self._renderer is not None  # it has counted the others
            sites = self._renderer.segment(camera, size, mujoco.mjtObj.mjOBJ_SITE)
            counts = {mark.name: int((sites == self._model.site(mark.site).id).sum()) for mark in marks}
            pixels |= {name: count for name, count in counts.items() if count}
        return pixels

    def _body_id(self, entity: Entity) -> int:
        return super()._body_id(entity) if entity.body else -1  # a mark

    def _new_renderer(self) -> Renderer:
        return Renderer(self._model, self._data, True, groups=DRAWN_GROUPS)


def _leading(task: Task) -> Iterator[Thing]:
    """Yield the things that something else comes along with."""
    return (thing for thing in task.things.values() if thing.fields or thing.marks)


def _names_of_places(task: Task) -> list[str]:
    return [
        f"{thing.name}.{follower}" if follower else thing.name
        for thing in _leading(task)
        for follower in ("", *thing.fields, *thing.marks)
    ]
