"""A robosuite environment for an embedded scene: the reference that our own stepping is compared with.

The world of the embedded substrate is built from this environment and then plays without it.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from pytest_libero_max.substrates.embedded.panda import add_robot
from pytest_libero_max.substrates.embedded.predicates import all_hold
from pytest_libero_max.substrates.embedded.scene import Scene
from pytest_libero_max.substrates.embedded.textures import upload
from pytest_libero_max.worlds.contract import WorldState
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import CONTROL_HZ, PANDA

gl.import_robosuite()

import mujoco  # noqa: E402
from robosuite.controllers import load_controller_config  # noqa: E402
from robosuite.environments.manipulation.single_arm_env import SingleArmEnv  # noqa: E402
from robosuite.utils import transform_utils  # noqa: E402

_MOUNTS = MappingProxyType({"rethink": "RethinkMount", "ground": None})


class SceneEnv(SingleArmEnv):  # type: ignore[misc]
    """Robosuite's Panda under ``OSC_POSE`` at 20 Hz in an embedded scene.

    Args:
        cameras: Cameras that ``step`` renders, as robosuite does it; none by default.
        size: Side of those images in pixels.
        hard_reset: True if ``reset`` compiles the model anew, as robosuite does by default.
    """

    def __init__(
        self, scene: Scene, cameras: Sequence[str] = (), size: int = 256, hard_reset: bool = False
    ) -> None:
        self._scene = scene
        super().__init__(
            robots=PANDA.name,
            controller_configs=load_controller_config(default_controller=PANDA.controller),
            mount_types=_MOUNTS[scene.mount],
            initialization_noise=None,
            use_camera_obs=bool(cameras),
            has_renderer=False,
            has_offscreen_renderer=bool(cameras),
            control_freq=CONTROL_HZ,
            ignore_done=True,
            hard_reset=hard_reset,
            camera_names=list(cameras) or "agentview",
            camera_heights=size,
            camera_widths=size,
        )

    def _load_model(self) -> None:
        super()._load_model()
        self.robots[0].init_qpos = np.array(PANDA.home_rad)
        robot = self.robots[0].robot_model
        robot._elements["root_body"].set("pos", " ".join(map(repr, self._scene.robot_base_pos)))
        document = ET.fromstring(self._scene.mjcf)
        add_robot(document, robot.root)
        self.model = _SceneModel(ET.tostring(document, encoding="unicode"))

    def _reset_internal(self) -> None:
        # Robosuite keeps the turn of the hand as a quaternion that nobody reads: not worth its compilation.
        turn_of = transform_utils.mat2quat
        transform_utils.mat2quat = getattr(turn_of, "py_func", turn_of)
        try:
            super()._reset_internal()
        finally:
            transform_utils.mat2quat = turn_of

    def _initialize_sim(self, xml_string: str | None = None) -> None:
        super()._initialize_sim(xml_string)
        upload(self.sim.model._model, self._scene.textures)

    def _destroy_sim(self) -> None:
        """Release the model and its data.

        Robosuite also collects the garbage of the whole process, which takes as long as building a scene.
        Only its own rendering needs that, or its GL context outlives the display.
        """
        if self.has_offscreen_renderer:
            # What it frees are numbers of a GL context: in another one they are somebody else's pictures.
            if self.sim is not None and self.sim._render_context_offscreen is not None:
                self.sim._render_context_offscreen.gl_ctx.make_current()
            super()._destroy_sim()
        elif self.sim is not None:
            del self.sim.data, self.sim.model
            self.sim: Any = None

    def assume(self, state: WorldState) -> None:
        """Continue from the state of the embedded world of the same scene.

        Args:
            state: Its snapshot. Alterations of the model are not taken over.
        """
        model, data = self.sim.model._model, self.sim.data._data
        mujoco.mj_setState(model, data, state.physics.copy(), mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(model, data)
        robot = self.robots[0]
        robot.controller.goal_ori = state.controller[:9].reshape(3, 3).copy()
        robot.controller.new_update = True
        robot.gripper.current_action = state.controller[9:].copy()

    def reward(self, action: Any = None) -> float:
        return float(self._check_success())

    def _check_success(self) -> bool:
        return all_hold(self._scene.goal, self.sim.model._model, self.sim.data._data)


class _SceneModel:
    """Members that robosuite asks of a task's model when the document is already complete."""

    mujoco_objects: tuple[Any, ...] = ()

    def __init__(self, document: str) -> None:
        self._document = document

    def get_xml(self) -> str:
        return self._document

    def generate_id_mappings(self, sim: Any) -> None:
        """Do nothing: segmentation images are not offered."""
