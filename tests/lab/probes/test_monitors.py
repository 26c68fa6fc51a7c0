"""Scores of the monitors, on observations and answers that are made up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_libero_max.lab.probes.monitors import ActionSpread, ChunkChange, ImageChange, SceneDistance
from pytest_libero_max.pairing.probes.monitor import IMAGE_SIZE, Monitor

NOTHING = np.zeros((4, 7))


def scores(monitor: Monitor[Any], *queries: tuple[Any, Any, int]) -> list[float]:
    """Scores of queries in a row: observation, actions, step."""
    memory, found = None, []
    for observation, actions, step in queries:
        memory, score = monitor.observe(memory, observation, actions, step)
        hash(memory)
        found.append(score)
    return found


def seen(level: int, corner: int | None = None) -> dict[str, Any]:
    """A grey image, with another level in the 8 x 8 pixels of its first corner."""
    image = np.full((IMAGE_SIZE, IMAGE_SIZE, 3), level, dtype=np.uint8)
    if corner is not None:
        image[:8, :8] = corner
    return {"agentview_image": image}


def test_answers_are_compared_over_the_steps_that_both_plan() -> None:
    first = np.arange(28.0).reshape(4, 7)
    shifted = np.vstack([first[2:], first[:2]])
    other = shifted.copy()
    other[0] += 3.0  # one of the two steps that both plan
    assert scores(ChunkChange(), ({}, first, 0), ({}, shifted, 2)) == [0.0, 0.0]
    assert scores(ChunkChange(), ({}, first, 0), ({}, other, 2)) == [0.0, pytest.approx(3.0 / np.sqrt(2))]
    assert scores(ChunkChange(), ({}, first, 0), ({}, other, 4)) == [0.0, 0.0]


def test_the_spread_of_motions_leaves_out_the_gripper() -> None:
    actions = np.zeros((4, 7))
    actions[::2, 0], actions[1::2, 0] = 0.6, -0.6
    actions[:, 6] = [1, -1, 1, -1]
    assert scores(ActionSpread(), ({}, actions, 0)) == [pytest.approx(0.1)]


def test_an_image_is_compared_with_the_one_before() -> None:
    queries = [(seen(10), NOTHING, 0), (seen(30), NOTHING, 2), (seen(25), NOTHING, 4)]
    assert scores(ImageChange(), *queries) == [0.0, 20.0, 5.0]


def test_the_scene_is_compared_with_the_first_image_by_mean_colours() -> None:
    queries = [(seen(10), NOTHING, 0), (seen(10, 90), NOTHING, 2), (seen(30), NOTHING, 4)]
    assert scores(SceneDistance(), *queries) == [0.0, pytest.approx(80.0 / 8), 20.0]
