"""Both measurements on a genuine scene: our loop compared with the installed package's environment.

The clock is the one of :mod:`.step_speed`: processor time, that of one idle core. The
package's loop is that of an evaluation without this project: a hard reset for each rollout, both cameras
rendered at every step, the executed prefix played again.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import numpy as np

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import SimulatorError
from pytest_libero_max.makers.bench.clock import processor_seconds
from pytest_libero_max.makers.bench.pair_runner import IMAGE_SIZE, QUERY_INTERVAL, Hovering, rollouts_of
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.substrates.libero.importing import imported
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.tasks import task_of
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.robot import ACTION_DIM, NOOP_ACTION

WARM_UP = 5


@dataclass(frozen=True)
class GenuineTimes:
    """Medians of processor time."""

    origin: str
    item_id: str
    lean_ms: float
    """Our control step."""
    package_ms: float
    """The package's ``env.step`` with every camera observable off."""
    images_ms: float
    """Its ``env.step`` with both cameras."""
    fork_s: float | None = None
    """A pair in the pair runner; None where no pair was measured."""
    plain_s: float | None = None
    """The same pair in the package's loop; likewise."""
    steps: int = 0
    """Control steps of the two rollouts as the package's loop plays them."""

    def lines(self) -> list[str]:
        lines = [
            f"{self.origin}, {self.item_id}, median processor times",
            f"  lean step                        {self.lean_ms:8.2f} ms  {1000 / self.lean_ms:6.0f} steps/s",
            f"  package's step, no cameras       {self.package_ms:8.2f} ms  "
            f"{self.package_ms / self.lean_ms:6.1f} times the lean step",
            f"  package's step, two {IMAGE_SIZE} px images{self.images_ms:7.2f} ms  "
            f"{self.images_ms / self.lean_ms:6.1f} times the lean step",
        ]
        if self.fork_s is None or self.plain_s is None:
            return lines
        return [
            *lines,
            f"  pair runner, Q = {QUERY_INTERVAL}              {self.fork_s:8.2f} s   "
            f"{60 / self.fork_s:6.2f} pairs/min",
            f"  package's loop, {self.steps} steps        {self.plain_s:8.2f} s   "
            f"{self.plain_s / self.fork_s:6.1f} times the pair runner",
        ]


def measure_genuine(
    substrate: LiberoSubstrate, suite: str = "libero_spatial", *, steps: int = 60, repeats: int = 1
) -> GenuineTimes:
    """Time random control steps and the first ``camera_shift`` pair of a suite of the original track.

    Raises:
        SimulatorError: The two did not arrive at the same states, so that their times mean nothing.
    """
    cases = (case for case in load_track("original") if case.suite == suite)
    case = next(case for case in cases if case.event.name == "camera_shift")
    world = substrate.world(case)
    plain, seeing = (package_env(substrate, case, images) for images in (False, True))
    origin = str(substrate.installation_for("libero"))
    times = GenuineTimes(origin, case.item_id, *_steps(world, plain, seeing, case, steps))
    if repeats:
        times = _with_pairs(times, world, seeing, case, repeats)
    for env in (plain, seeing):
        _make_current(env)
        env.close()
    return times


def _with_pairs(
    times: GenuineTimes, world: LiberoWorld, seeing: Any, case: Case, repeats: int
) -> GenuineTimes:
    world.reset(case.init_state_index)
    for _ in range(SETTLE_STEPS):
        world.step(NOOP_ACTION)  # LIBERO's objects start in the air
    policy = Hovering(world.position(case.event.entity) + np.array([0.0, 0.0, 0.15]))
    pair = measure_pair(case, world, policy)
    if pair.dynamic is None:
        raise SimulatorError(f"{case.item_id}: the event never fired, so there is no pair to measure.")
    rollouts = rollouts_of(pair)
    ends = play_here(world, case, rollouts)

    def play_plainly() -> None:
        if not np.array_equal(play_there(seeing, world, case, rollouts), ends):
            raise SimulatorError(f"{case.item_id}: the package's loop arrived elsewhere.")

    paired, plains = [], []
    for _ in range(repeats):
        paired.append(processor_seconds(lambda: measure_pair(case, world, policy)))
        plains.append(processor_seconds(play_plainly))
    steps = sum(map(len, rollouts))
    return replace(times, fork_s=median(paired), plain_s=median(plains), steps=steps)


def package_env(substrate: LiberoSubstrate, case: Case, images: bool) -> Any:
    """Return the package's wrapper of a case's task, with both cameras or without any."""
    installation = substrate.installation_for("libero")
    bddl = str(task_of(installation, case.suite, case.task_index).bddl)
    with imported(installation) as environments:
        if images:
            env = environments.OffScreenRenderEnv(
                bddl_file_name=bddl, camera_heights=IMAGE_SIZE, camera_widths=IMAGE_SIZE
            )
        else:
            wrappers = importlib.import_module("libero.libero.envs.env_wrapper")
            env = wrappers.ControlEnv(bddl_file_name=bddl, use_camera_obs=False, has_offscreen_renderer=False)
    return env


def _start(env: Any, world: LiberoWorld, case: Case) -> None:
    _make_current(env)
    env.seed(case.policy_seed)
    env.reset()
    env.set_init_state(world.initial_state(case.init_state_index))


def _make_current(env: Any) -> None:
    context = env.sim._render_context_offscreen
    if context is not None:  # the package draws into whatever context is current
        context.gl_ctx.make_current()


def _steps(world: LiberoWorld, plain: Any, seeing: Any, case: Case, steps: int) -> tuple[float, float, float]:
    world.reset(case.init_state_index)
    for env in (plain, seeing):
        _start(env, world, case)
    times: tuple[list[float], ...] = ([], [], [])
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (WARM_UP + steps, ACTION_DIM)):
        _make_current(seeing)
        for env, seconds in zip((world, plain, seeing), times, strict=True):
            seconds.append(1000.0 * processor_seconds(lambda env=env, action=action: env.step(action)))
    for env in (plain, seeing):
        if not np.array_equal(env.sim.data.qpos, world.data.qpos):
            raise SimulatorError(f"{world.scene}: our steps and the package's parted.")
    lean, package, images = (median(seconds[WARM_UP:]) for seconds in times)
    return lean, package, images


def play_there(env: Any, world: LiberoWorld, case: Case, rollouts: Sequence[Array]) -> list[Array]:
    """Return the joint positions in which (n, 7) actions end in the package's environment."""
    ends = []
    for actions in rollouts:
        _start(env, world, case)
        for action in actions:
            env.step(action)
        ends.append(env.sim.data.qpos.copy())
    return ends


def play_here(world: LiberoWorld, case: Case, rollouts: Sequence[Array]) -> list[Array]:
    """Return the joint positions in which the rollouts end in our loop."""
    ends = []
    for actions in rollouts:
        world.reset(case.init_state_index)
        for action in actions:
            world.step(action)
        ends.append(world.data.qpos.copy())
    return ends
