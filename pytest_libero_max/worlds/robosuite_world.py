"""A world around a robosuite environment with one arm: its controller, its grip site, its joints."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.contract import Array, Entity
from pytest_libero_max.worlds.mujoco_world import FASTEST, MujocoWorld
from pytest_libero_max.worlds.privileged import GraspablePart
from pytest_libero_max.worlds.robot import PANDA, MujocoRobot
from pytest_libero_max.worlds.stepping import Stepper

_HINGE = 3  # mjJNT_HINGE


class RobosuiteWorld(MujocoWorld):
    """Plays robosuite's ``env.step`` on an environment's model and data, without calling it.

    Args:
        env: A robosuite 1.4 ``SingleArmEnv``, after its reset. It must not be stepped or reset by anybody
            else while the world is in use.
    """

    def __init__(
        self,
        scene: str,
        language: str,
        env: Any,
        entities: Mapping[str, Entity],
        robot: MujocoRobot = PANDA,
    ) -> None:
        super().__init__(scene, language, env.sim.model._model, env.sim.data._data, entities, robot)
        arm = env.robots[0]
        self._env = env
        self._stepper = Stepper(env)
        self._grip_site = int(arm.eef_site_id)
        self._hand_body = int(env.sim.model.body_name2id(arm.robot_model.eef_name))

    @abstractmethod
    def succeeded(self) -> bool: ...

    @abstractmethod
    def _task_fields(self) -> Mapping[str, Any]:
        """Return the task's own goal and the parts that are made to be held, as JSON values."""

    def _decided(self) -> Mapping[str, Any]:
        control = {f"control.{name}": value for name, value in self._stepper.constants.items()}
        return {**self._task_fields(), **control}

    def joint_position(self, joint: str) -> float:
        return float(self._data.joint(joint).qpos[0])

    def is_hinge(self, joint: str) -> bool:
        return int(self._model.joint(joint).type[0]) == _HINGE

    def region(self, name: str) -> Array | None:
        try:
            middle: Array = self._data.site(name).xpos.copy()
        except KeyError:
            return None
        return middle

    def part_position(self, part: GraspablePart) -> Array:
        return part.world(self._data)[0]

    def end_effector(self) -> Array:
        position: Array = self._data.site_xpos[self._grip_site].copy()
        return position

    def pose_arm(self, joints: Sequence[float] | Array) -> None:
        values = np.array(joints, dtype=np.float64)
        arm = self._stepper.arm_qpos
        limits = self._model.jnt_range[self._env.robots[0]._ref_joint_indexes]
        if values.shape != arm.shape or not np.all((values > limits[:, 0]) & (values < limits[:, 1])):
            raise SubstrateError(
                f"joints={values.tolist()!r}: {arm.size} angles in rad within the joints' limits are needed."
            )
        self._data.qpos[arm] = values
        self._data.qvel[self._stepper.arm_dofs] = 0.0
        self._data.qacc_warmstart[self._stepper.arm_dofs] = 0.0
        self._settle()
        self._reset_controller()
        self._after_alteration()

    def open_gripper(self) -> None:
        self._stepper.open_grip()
        self._after_alteration()

    def _reset_controller(self) -> None:
        self._stepper.start()

    def _controller_state(self) -> Array:
        return self._stepper.state()

    def _set_controller_state(self, state: Array) -> None:
        self._stepper.restore(state)

    def _control_step(self, action: Array) -> bool:
        return self._stepper.step(action, self._control) <= FASTEST

    def _proprioception(self) -> dict[str, Array]:
        stepper, data = self._stepper, self._data
        values = (
            self.end_effector(),
            # Indexing with index arrays copies, so nothing here follows the live data.
            np.roll(data.xquat[self._hand_body], -1),
            data.qpos[stepper.finger_qpos],
            data.qvel[stepper.finger_dofs],
            data.qpos[stepper.arm_qpos],
            data.qvel[stepper.arm_dofs],
        )
        return dict(zip(self._robot.state, values, strict=True))

    def close(self) -> None:
        super().close()
        self._env.close()
