"""The boxes that the expert sees its surroundings as."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_libero_max.experts.scene_view import Boxes


@pytest.mark.parametrize("reach", [0.05, 0.1, 0.3])
def test_boxes_that_are_left_out_are_out_of_reach(reach: float) -> None:
    draw = np.random.default_rng(7)
    turn = Rotation.random(200, rng=draw).as_matrix()
    boxes = Boxes(draw.uniform(-1, 1, (200, 3)), turn, draw.uniform(0.005, 0.15, (200, 3)))
    points = draw.uniform(-0.1, 0.1, (50, 3))
    near = boxes.near(points, reach)
    assert 0 < len(near.centre) < len(boxes.centre)
    within = boxes.distance(points) <= reach
    assert within.any()
    assert np.array_equal(near.distance(points)[within], boxes.distance(points)[within])
    assert (near.distance(points)[~within] > reach).all()
