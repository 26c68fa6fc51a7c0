"""Play all fifty tasks twice over: ``python -m tests.lab.metaworld.all_tasks [INDEX ...]``.

Of each task it compares, bit for bit, the futures of a restored snapshot in the same world and another one,
a replay from the reset, and the package's own ``env.step``. It ends with status 1 where something differs.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from pytest_libero_max.lab.metaworld.robot import MT50
from pytest_libero_max.lab.metaworld.scene import build
from pytest_libero_max.lab.metaworld.tasks import Task, task
from pytest_libero_max.lab.metaworld.world import MetaworldWorld
from pytest_libero_max.worlds.contract import Array

STEPS, FORK = 60, 31


def scripted(name: str) -> Callable[[Array], Array]:
    """Return the package's own policy of a task, with actions clipped."""
    from metaworld.policies import ENV_POLICY_MAP

    kind: Any = ENV_POLICY_MAP[name]
    policy = kind()

    def act(observation: Array) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            action: Array = np.clip(policy.get_action(observation), -1.0, 1.0, dtype=np.float64)
        return action

    return act


def differences(row: Task, init: int = 0, steps: int = STEPS) -> list[str]:
    """Return the ways in which a task is not the same again; empty where it is."""
    world, other, act = MetaworldWorld(row), MetaworldWorld(row), scripted(row.name)
    world.reset(init)
    start = world.snapshot()
    actions, digests = [], []
    forked = None
    for step in range(steps):
        if step == FORK:
            forked = world.snapshot()
        actions.append(act(world.task_observation()))
        world.step(actions[-1])
        digests.append(world.digest())
    assert forked is not None
    found = []
    for name, played, state, first in (
        ("fork", world, forked, FORK),
        ("fork in another world", other, forked, FORK),
        ("restored start", world, start, 0),
    ):
        played.restore(state)
        if _digests(played, actions[first:]) != digests[first:]:
            found.append(name)
    world.reset((init + 1) % MT50.states)
    world.reset(init)
    if _digests(world, actions) != digests:
        found.append("replay")
    if not _is_as_the_package(row, init, actions, world):
        found.append("the package's own step")
    world.close()
    other.close()
    return found


def _digests(world: MetaworldWorld, actions: list[Array]) -> list[bytes]:
    digests = []
    for action in actions:
        world.step(action)
        digests.append(world.digest())
    return digests


def _is_as_the_package(row: Task, init: int, actions: list[Array], world: MetaworldWorld) -> bool:
    """Return True if the package's environment, reset and stepped by itself, ends in the same state."""
    env: Any = build(row, ())
    env.seed(init)
    env.reset()
    info: dict[str, Any] = {}
    for action in actions:
        _, _, _, _, info = env.step(action)
    same = env.data.qpos.tobytes() == world.data.qpos.tobytes()
    return same and bool(info["success"]) == world.succeeded()


def main() -> int:
    """Print a line for each task."""
    chosen = [int(word) for word in sys.argv[1:]] or range(MT50.tasks)
    failures = 0
    for index in chosen:
        found = differences(task(index))
        failures += bool(found)
        print(f"{index:2} {task(index).name:30} {', '.join(found) or 'the same'}", flush=True)
    print(f"{len(chosen) - failures} of {len(chosen)} tasks are the same again, bit for bit")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
