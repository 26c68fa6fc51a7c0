"""Time of a control step: ours, robosuite's, and the bare physics of it, in one run.

Everything is measured in turns, step by step, on the same scene along the same trajectory. The clock is
the processor time of the whole process, render threads included: that of one idle core, also when the
machine is busy. Medians are reported.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median

import numpy as np

from pytest_libero_max.errors import SimulatorError, counted
from pytest_libero_max.makers.bench.clock import processor_seconds
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.robot import ACTION_DIM, CAMERAS, CONTROL_HZ

gl.prepare()

import mujoco  # noqa: E402

from pytest_libero_max.substrates.embedded.env import SceneEnv  # noqa: E402

WARM_UP = 5
"""Steps before the clock counts: compilation, caches, the first images."""


@dataclass(frozen=True)
class StepTimes:
    """Medians in milliseconds of processor time."""

    scene: str
    steps: int
    lean: float
    """Our control step."""
    robosuite: float
    """Robosuite's ``env.step`` without cameras."""
    robosuite_images: float | None
    """Robosuite's ``env.step`` with the two cameras; None without OpenGL."""
    bare: float
    """As many ``mj_step`` as a control step has, from the same state."""
    passes: float
    """The physics that ``env.step`` does: two ``mj_forward`` before each ``mj_step``."""
    image: float | None
    """One image of ours; None without OpenGL."""
    size: int
    contacts: int
    """Contacts at the end, as a measure of how busy the scene is."""

    def lines(self) -> list[str]:
        rows = [
            ("lean step", self.lean, f"{1000 / self.lean:.0f} steps/s"),
            (
                "  of which bare mj_step",
                self.bare,
                f"the lean step is {self.lean / self.bare:.2f} times that",
            ),
            ("  of which controller and gripper", self.lean - self.bare, ""),
            ("robosuite env.step", self.robosuite, f"{self.robosuite / self.lean:.1f} times the lean step"),
            ("  of which three physics passes", self.passes, ""),
            ("  of which Python", self.robosuite - self.passes, ""),
        ]
        if self.robosuite_images is not None:
            note = f"{self.robosuite_images / self.lean:.1f} times the lean step"
            rows.append((f"robosuite env.step, two {self.size} px images", self.robosuite_images, note))
        if self.image is not None:
            rows.append((f"one {self.size} px image", self.image, ""))
        title = f"{self.scene}: {counted(self.steps, 'control step')}, "
        title += f"{counted(self.contacts, 'contact')} at the end, median processor times"
        return [title, *(f"  {what:<42} {value:7.2f} ms  {note}".rstrip() for what, value, note in rows)]


def measure_stepping(
    suite: str = "libero_spatial", index: int = 0, *, steps: int = 60, size: int = 256, images: bool = True
) -> StepTimes:
    """Time control steps with random actions, and images of ``size`` pixels where there is OpenGL.

    Raises:
        SimulatorError: Our step and robosuite's parted, so that their times could not be compared.
    """
    scene = build_scene(suite, index)
    world = EmbeddedWorld(scene)
    images = images and gl.prepare() in gl.OFFSCREEN
    plain, seeing = SceneEnv(scene), SceneEnv(scene, CAMERAS, size) if images else None
    environments = [env for env in (plain, seeing) if env is not None]
    for env in environments:
        env.reset()
        env.assume(world.snapshot())
    scratch = mujoco.MjData(world.model)
    substeps = round(1.0 / (CONTROL_HZ * world.model.opt.timestep))
    model = world.model

    def from_here() -> None:
        """Put the scratch data where the world is."""
        state = world.snapshot().physics.copy()
        mujoco.mj_setState(model, scratch, state, mujoco.mjtState.mjSTATE_INTEGRATION)

    def passes() -> None:
        for _ in range(substeps):
            mujoco.mj_forward(model, scratch)
            mujoco.mj_forward(model, scratch)
            mujoco.mj_step(model, scratch)

    times: dict[str, list[float]] = defaultdict(list)
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (WARM_UP + steps, ACTION_DIM)):
        from_here()
        times["bare"].append(_ms(mujoco.mj_step, model, scratch, substeps))
        from_here()
        times["passes"].append(_ms(passes))
        times["lean"].append(_ms(world.step, action))
        times["robosuite"].append(_ms(plain.step, action))
        if seeing is not None:
            times["image"].append(_ms(world.observe, CAMERAS[:1], size))
            # Robosuite draws into whatever context is current.
            seeing.sim._render_context_offscreen.gl_ctx.make_current()
            times["robosuite_images"].append(_ms(seeing.step, action))
    for env in environments:
        if not np.array_equal(env.sim.data._data.qpos, world.data.qpos):
            raise SimulatorError(f"{world.scene}: our steps and robosuite's parted, so times mean nothing.")
    medians = {name: median(values[WARM_UP:]) for name, values in times.items()}
    contacts = int(world.data.ncon)
    for env in environments:
        env.close()
    world.close()
    return StepTimes(
        scene=scene.key,
        steps=steps,
        lean=medians["lean"],
        robosuite=medians["robosuite"],
        robosuite_images=medians.get("robosuite_images"),
        bare=medians["bare"],
        passes=medians["passes"],
        image=medians.get("image"),
        size=size,
        contacts=contacts,
    )


def _ms(act: Callable[..., object], *arguments: object) -> float:
    return 1000.0 * processor_seconds(act, *arguments)
