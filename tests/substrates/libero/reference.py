"""The package's own wrapper, put into an initial state as the authors' runner does it."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from pytest_libero_max.substrates.libero.importing import imported
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.tasks import Task
from pytest_libero_max.substrates.libero.world import LiberoWorld
from tests.worlds.states import integration_state

PROPRIOCEPTION = (
    "robot0_eef_pos",
    "robot0_eef_quat",
    "robot0_gripper_qpos",
    "robot0_gripper_qvel",
    "robot0_joint_pos",
    "robot0_joint_vel",
)


class Reference:
    """``OffScreenRenderEnv``, or without images the ``ControlEnv`` that it is made of."""

    def __init__(
        self, installation: Installation, task: Task, seed: int, images: bool = False, pixels: int = 128
    ) -> None:
        with imported(installation):
            wrappers = importlib.import_module(f"{installation.inner}.envs.env_wrapper")
            name = str(task.bddl)
            if images:
                self.env: Any = wrappers.OffScreenRenderEnv(
                    bddl_file_name=name, camera_heights=pixels, camera_widths=pixels
                )
            else:
                self.env = wrappers.ControlEnv(
                    bddl_file_name=name, use_camera_obs=False, has_offscreen_renderer=False
                )
            self.env.env.hard_reset = False
            self.env.seed(seed)
            self.env.reset()
        if images:
            self._show_textures_as_they_are()
        self.observation: Any = None
        self.done = False

    @property
    def model(self) -> mujoco.MjModel:
        return self.env.sim.model._model

    @property
    def data(self) -> mujoco.MjData:
        return self.env.sim.data._data

    @property
    def state(self) -> Any:
        return integration_state(self.model, self.data)

    def start(self, state: Any, taken_out: Sequence[str] = (), away: Sequence[float] = ()) -> None:
        """Set the state, look twice to see that the renderer is steady, and once after the setup."""
        self._make_current()
        self.env.set_init_state(state)
        for _ in range(2):
            self.refresh()
        for name in taken_out:
            joint = self.data.joint(f"{name}_joint0")
            joint.qpos[:3], joint.qvel[:] = away, 0.0
        self.refresh()

    def step(self, action: Any) -> None:
        self._make_current()
        self.observation, _, self.done, _ = self.env.step(np.array(action))

    def refresh(self) -> None:
        """What the authors do after an event, and before the first step."""
        self._make_current()
        inner = self.env.env
        inner.sim.forward()
        inner._post_process()
        inner._update_observables(force=True)
        self.observation = inner._get_observations()

    def close(self) -> None:
        self._make_current()
        self.env.close()

    def _make_current(self) -> None:
        context = self.env.sim._render_context_offscreen
        if context is not None:
            context.gl_ctx.make_current()

    def _show_textures_as_they_are(self) -> None:
        self.model.tex_colorspace[:] = 1
        context = self.env.sim._render_context_offscreen
        context.gl_ctx.make_current()
        for texture in range(self.model.ntex):
            mujoco.mjr_uploadTexture(self.model, context.con, texture)


def assert_same(world: LiberoWorld, reference: Reference, where: str) -> None:
    """Equal states, observations and success, bit for bit; equal images where the reference has them."""
    ours, theirs = world.snapshot().physics, reference.state
    assert np.array_equal(ours, theirs), f"{where}: states are off by {np.abs(ours - theirs).max()}"
    cameras = [key.removesuffix("_image") for key in reference.observation if key.endswith("_image")]
    seen = world.observe(cameras, 128)
    for key in (*PROPRIOCEPTION, *(f"{camera}_image" for camera in cameras)):
        assert np.array_equal(seen[key], reference.observation[key]), f"{where}: {key} differs"
    assert world.succeeded() == bool(reference.done), f"{where}: success differs"
