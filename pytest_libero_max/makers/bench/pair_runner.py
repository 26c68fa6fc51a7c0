"""Pairs per minute: the pair runner compared with a plain evaluation loop.

The clock is the one of :mod:`.step_speed`: processor time, that of one idle core.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import SETTLE_STEPS, Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import SimulatorError, counted
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.makers.bench.clock import processor_seconds
from pytest_libero_max.pairing.runner import Pair, PairSettings, measure_pair
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.substrates.embedded.env import SceneEnv
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION

QUERY_INTERVAL = 10
IMAGE_SIZE = 256


class Hovering:
    """Goes to a place above the trigger entity and waits there: no cost of its own, and the event fires."""

    def __init__(self, place: NDArray[np.float64]) -> None:
        self.spec = PolicySpec("hovering", QUERY_INTERVAL, QUERY_INTERVAL, CAMERAS, IMAGE_SIZE)
        self._place = place

    def reset(self, episode: Episode) -> None:
        """Do nothing: the policy has no memory."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        step = (self._place - observation["robot0_eef_pos"]) / (0.05 * QUERY_INTERVAL)
        action = np.concatenate([np.clip(step, -1.0, 1.0), [0.0, 0.0, 0.0, -1.0]])
        return np.tile(action, (QUERY_INTERVAL, 1))


@dataclass(frozen=True)
class PairTimes:
    """Medians in seconds for one pair of the same case with the same actions."""

    item_id: str
    """The case."""
    steps: int
    """Control steps in both rollouts together, as the plain loop plays them."""
    fork: float
    """The pair runner."""
    replay: float
    """The pair runner, replaying the prefix."""
    plain: float
    """Robosuite's ``env.step`` with both cameras at every step, the prefix replayed with rendering, the
    environment reset softly (the model is kept)."""
    plain_hard: float
    """The same with robosuite's default, a hard reset before each rollout."""

    def lines(self) -> list[str]:
        rows = [("pair runner, fork", self.fork), ("pair runner, replay", self.replay)]
        rows += [("plain loop, soft resets", self.plain), ("plain loop, hard resets", self.plain_hard)]
        return [
            f"{self.item_id}: {counted(self.steps, 'control step')}, Q = {QUERY_INTERVAL}, "
            f"two {IMAGE_SIZE} px images, medians",
            *(
                f"  {name:<26}{seconds:8.2f} s  {60 / seconds:6.1f} pairs/min  "
                f"{seconds / self.fork:5.1f} times fork"
                for name, seconds in rows
            ),
        ]


def case_of(suite: str, task_index: int) -> Case:
    """Return a case of a scene whose event moves nothing: that of the original track, where it has one."""
    scene = (suite, task_index, "camera_shift")
    frozen = (
        case for case in load_track("original") if (case.suite, case.task_index, case.event.name) == scene
    )
    return next(frozen, None) or make_case("camera_shift", suite, task_index)


def measure_pairs(suite: str = "libero_spatial", task_index: int = 0, *, repeats: int = 3) -> PairTimes:
    """Time a pair of a scene with a policy that costs nothing, in turns with the plain loop.

    Raises:
        SimulatorError: The two did not arrive at the same states, so that their times mean nothing.
    """
    case = case_of(suite, task_index)
    scene = build_scene(case.suite, case.task_index)
    world = EmbeddedWorld(scene)
    world.reset(case.init_state_index)
    policy = Hovering(world.position(case.event.entity) + np.array([0.0, 0.0, 0.15]))
    envs = {hard: SceneEnv(scene, CAMERAS, IMAGE_SIZE, hard_reset=hard) for hard in (False, True)}
    pair = measure_pair(case, world, policy)
    final = final_positions(world, case, pair)
    times: dict[str, list[float]] = {"fork": [], "replay": [], "plain": [], "plain_hard": []}
    for _ in range(repeats):
        times["fork"].append(processor_seconds(lambda: measure_pair(case, world, policy)))
        times["replay"].append(
            processor_seconds(lambda: measure_pair(case, world, policy, PairSettings(prefix="replay")))
        )
        for hard, env in envs.items():
            times["plain_hard" if hard else "plain"].append(_plain(env, world, case, pair))
            if not np.array_equal(env.sim.data._data.qpos, final):
                raise SimulatorError(
                    f"{case.item_id}: the plain loop arrived elsewhere; its time means nothing."
                )
    for env in envs.values():
        env.close()
    world.close()
    return PairTimes(
        item_id=case.item_id,
        steps=sum(len(actions) for actions in rollouts_of(pair)),
        **{name: median(values) for name, values in times.items()},
    )


def _plain(env: SceneEnv, world: EmbeddedWorld, case: Case, pair: Pair) -> float:
    _begin(world, case)
    start = world.snapshot()
    seconds = 0.0
    for actions in rollouts_of(pair):
        begin = time.process_time()
        env.reset()
        env.assume(start)
        for action in actions:
            env.step(action)
        seconds += time.process_time() - begin
    return seconds


def final_positions(world: EmbeddedWorld, case: Case, pair: Pair) -> NDArray[np.float64]:
    """Return the joint positions, (nq,), at the end of the pair's last arm, its actions played in the world.

    Raises:
        SimulatorError: The hand is not where the arm left it.
    """
    _begin(world, case)
    for action in rollouts_of(pair)[-1]:
        world.step(action)
    arm = pair.base if pair.dynamic is None else pair.dynamic
    if not np.array_equal(world.end_effector(), arm.end_effector[-1]):
        raise SimulatorError(f"{case.item_id}: the actions of the last arm lead elsewhere when played again.")
    final: NDArray[np.float64] = world.data.qpos.copy()
    return final


def _begin(world: EmbeddedWorld, case: Case) -> None:
    world.reset(case.init_state_index)
    for change in case.event.setup:
        change_from_dict(change).apply(world)


def rollouts_of(pair: Pair) -> list[NDArray[np.float64]]:
    """Return the actions of both rollouts, the waiting at their beginning included."""
    settle = np.tile(NOOP_ACTION, (SETTLE_STEPS, 1))
    arms = [pair.base] if pair.dynamic is None else [pair.base, pair.dynamic]
    return [np.vstack([settle, arm.actions]) for arm in arms]
