"""Worlds of Fetch: the model, the step and the success of gymnasium-robotics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np
from fetch_world import FETCH, LANGUAGE, SPARES, Array  # type: ignore[import-not-found]
from gymnasium_robotics.envs.fetch.pick_and_place import MujocoFetchPickAndPlaceEnv
from gymnasium_robotics.envs.fetch.push import MujocoFetchPushEnv

from pytest_libero_max import Case, Entity, MujocoWorld
from pytest_libero_max.errors import SubstrateError

INITS = (
    (1.204, 0.604, 1.436, 0.873, 0.425),
    (1.345, 0.884, 1.235, 0.884, 0.797),
    (1.436, 0.627, 1.372, 0.818, 0.548),
    (1.218, 0.670, 1.432, 0.774, 0.640),
    (1.475, 0.752, 1.485, 0.623, 0.786),
    (1.433, 0.841, 1.347, 0.685, 0.609),
    (1.488, 0.789, 1.394, 0.698, 0.448),
    (1.379, 0.868, 1.425, 0.667, 0.425),
    (1.290, 0.895, 1.288, 0.836, 0.622),
    (1.453, 0.685, 1.373, 0.832, 0.425),
)
"""Places of block (x, y) and ball (x, y, z), m, as FetchPickAndPlace draws them with the seeds 0 to 9."""
_ON_TABLE_M = 0.425
"""Height of the ball of FetchPush."""


class _WithBoxes:
    """A Fetch environment whose scene also has a ball to see at the goal, and five boxes."""

    fullpath: str
    initial_qpos: Any
    _utils: Any
    _env_setup: Any

    def _initialize_simulation(self) -> None:
        spec = mujoco.MjSpec.from_file(self.fullpath)
        for geom in spec.geoms:
            if geom.parent.name != "robot0:mocap":  # marks of the hand's target
                geom.group = 1  # which is drawn
        spec.delete(spec.site("target0"))
        ball = spec.worldbody.add_body(name="ball")
        look = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [0.02] * 3, "rgba": [1, 0, 0, 1]}
        ball.add_geom(**look, contype=0, conaffinity=0, group=1)
        for number, name in enumerate(SPARES):
            box = spec.worldbody.add_body(name=name, pos=[1.1 + 0.1 * number, 1.05, 0.42])
            box.add_freejoint()
            colour = [0.2 + 0.15 * number, 0.6, 0.9 - 0.15 * number, 1.0]
            box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02] * 3, rgba=colour, mass=0.1, group=1)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._model_names = self._utils.MujocoModelNames(self.model)
        self._env_setup(initial_qpos=self.initial_qpos)
        self.initial_time = self.data.time
        self.initial_qpos, self.initial_qvel = self.data.qpos.copy(), self.data.qvel.copy()


_ENVIRONMENTS: tuple[Any, ...] = tuple(
    type(env.__name__, (_WithBoxes, env), {}) for env in (MujocoFetchPickAndPlaceEnv, MujocoFetchPushEnv)
)
_ENTITIES = {
    "block": Entity("block", "block", "object", "object0", support="table"),
    "ball": Entity("ball", "ball", "fixture", "ball", support="table"),
    "table": Entity("table", "table", "surface", "table0"),
    **{name: Entity(name, "box", "object", name, support="table") for name in SPARES},
}


class FetchWorld(MujocoWorld):
    """One task."""

    def __init__(self, index: int) -> None:
        self._env = _ENVIRONMENTS[index]()
        super().__init__(f"fetch/{index}", LANGUAGE, self._env.model, self._env.data, _ENTITIES, FETCH)
        self._ball = self._model.body("ball").id
        self._link = self._model.body(FETCH.hand_body).id
        self._arm, self._fingers = (
            [int(self._model.joint(name).qposadr[0]) for name in names]
            for names in (FETCH.arm_joints, FETCH.finger_joints)
        )
        self.reset(0)

    def reset(self, init: int) -> None:
        super().reset(init)
        for number, name in enumerate(SPARES):
            self.park(name, (-3.0, 0.5 * number, -5.0))

    def park(self, entity: str, position: Sequence[float] | Array) -> None:
        super().park(entity, position)
        # In the order of the spares, so that one that came and went again leaves no trace.
        self._parked = {name: self._parked[name] for name in _ENTITIES if name in self._parked}

    def _initial_qpos(self, init: int) -> Array:
        if not 0 <= init < len(INITS):
            raise SubstrateError(f"init={init}: this world has initial states 0 to {len(INITS) - 1}.")
        x, y, *self._goal = INITS[init]
        if self._env.block_gripper:
            self._goal[2] = _ON_TABLE_M
        qpos: Array = self._env.initial_qpos.copy()
        first = self._qpos_address("block")
        qpos[first : first + 2] = x, y
        return qpos

    def _reset_controller(self) -> None:
        self._data.qvel[:] = self._env.initial_qvel
        self._model.body_pos[self._ball] = self._goal
        self._settle()
        self._hand = self._pose_of_link()

    def _pose_of_link(self) -> Array:
        return np.concatenate([self._data.xpos[self._link], self._data.xquat[self._link]])

    def _controller_state(self) -> Array:
        # An action starts from where the hand was one substep before the state that MuJoCo holds.
        return self._hand.copy()

    def _set_controller_state(self, state: Array) -> None:
        self._hand = state.copy()

    def _control_step(self, action: Array) -> bool:
        clipped = np.clip(action, -1.0, 1.0)
        self._data.xpos[self._link], self._data.xquat[self._link] = self._hand[:3], self._hand[3:]
        self._env._set_action(clipped)
        self._env._mujoco_step(clipped)
        self._env._step_callback()
        self._hand = self._pose_of_link()
        self._settle()
        return False

    def _proprioception(self) -> dict[str, Array]:
        self._env.goal = self.position("ball")
        own = self._env._get_obs()
        joints, fingers = self._data.qpos[self._arm], self._data.qpos[self._fingers]
        return {**own, "arm": joints, "fingers": fingers}

    def end_effector(self) -> Array:
        position: Array = self._data.site("robot0:grip").xpos.copy()
        return position

    def succeeded(self) -> bool:
        return bool(self._env._is_success(self._data.site("object0").xpos, self.position("ball")))

    def _decided(self) -> Mapping[str, Any]:
        return {"goal_m": self._env.distance_threshold, "inits": INITS, "substeps": self._env.n_substeps}


class FetchSubstrate:
    """A world for each task, built anew where a policy wrote to its model."""

    name = "fetch"

    def __init__(self) -> None:
        self._worlds: dict[int, FetchWorld] = {}

    def world(self, case: Case) -> FetchWorld:
        known = self._worlds.get(case.task_index)
        if known is None or known.spoiled:
            self._worlds[case.task_index] = FetchWorld(case.task_index)
        return self._worlds[case.task_index]

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        fetch = version("gymnasium-robotics")
        return {"substrate": self.name, "gymnasium-robotics": fetch, **MujocoWorld.versions(images)}

    def close(self) -> None:
        for world in self._worlds.values():
            world.close()
        self._worlds.clear()
