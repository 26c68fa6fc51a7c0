"""Every task with every arm: our control step against robosuite's own, and a restored world against itself.

``python -m tests.lab.robosuite.every_task`` plays all fifteen and prints a line for each.
"""

from __future__ import annotations

import sys

import numpy as np

from pytest_libero_max.lab.robosuite.robots import ROBOTS
from pytest_libero_max.lab.robosuite.tasks import TASKS
from pytest_libero_max.lab.robosuite.world import TaskWorld
from tests.lab.robosuite.robosuites_own import play_ours, play_own
from tests.worlds.states import random_actions


def differing_step(world: TaskWorld, init: int, steps: int) -> int | None:
    """Return the first step after which our state differs from robosuite's; None where all are equal."""
    world.reset(init)
    for action in random_actions(7, 3):
        world.step(action)
    state, actions = world.snapshot(), random_actions(init, steps)
    ours = play_ours(world, actions)
    theirs = play_own(world, state, actions)
    pairs = enumerate(zip(ours, theirs, strict=True))
    return next((step for step, (one, other) in pairs if not np.array_equal(one, other)), None)


def diverging_step(world: TaskWorld, steps: int) -> int | None:
    """Return the first step at which a restored world differs from its first future; None for none."""
    world.reset(0)
    for action in random_actions(1, 4):
        world.step(action)
    state, futures = world.snapshot(), []
    for _ in range(2):
        digests = []
        for action in random_actions(2, steps):
            world.step(action)
            digests.append(world.digest())
        futures.append(digests)
        world.reset(2)
        world.restore(state)
    pairs = enumerate(zip(*futures, strict=True))
    return next((step for step, (first, second) in pairs if first != second), None)


def main() -> int:
    """Play every task with every arm; return the number of those that differ."""
    wrong = 0
    for robot in ROBOTS.values():
        for task in TASKS:
            world = TaskWorld(task, robot)
            steps = (differing_step(world, init=5, steps=40), diverging_step(world, steps=40))
            world.close()
            wrong += steps != (None, None)
            print(f"{world.scene}: first step unlike robosuite's {steps[0]}, unlike itself {steps[1]}")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
