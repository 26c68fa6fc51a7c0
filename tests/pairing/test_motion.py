"""Way and jerk of a hand on known paths."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.pairing.probes.motion import Motion
from pytest_libero_max.worlds.robot import CONTROL_HZ, PANDA


def seen(hand: Any) -> Any:
    """What the probe yields of a hand that was at these places, (n + 1, 3) m."""
    places = iter(hand)
    world = SimpleNamespace(end_effector=lambda: hand[0], robot=PANDA)
    next(places)
    executed = tuple(SimpleNamespace(end_effector=place) for place in places)
    view: Any = SimpleNamespace(world=world, trajectory=SimpleNamespace(executed=executed))
    return Motion().columns(Motion().start(view), view)


def test_a_cubic_path_has_its_third_derivative() -> None:
    seconds = np.arange(41) / CONTROL_HZ
    path = seconds[:, None] ** 3 * [0.3, 0.0, 0.4] / 6 + seconds[:, None] * [0.1, 0.2, 0.0]
    found = seen(path)
    assert found["jerk_m_s3"] == pytest.approx(0.5, abs=1e-4)
    assert found["step_jerk_m_s3"] == pytest.approx([0.5] * 38)


def test_a_straight_way_has_its_length_and_no_jerk() -> None:
    found = seen(np.linspace([0.1, 0.2, 0.3], [0.1, 0.5, 0.7], 26))
    assert found["path_m"] == pytest.approx(0.5)
    assert found["step_m"] == [0.02] * 25
    assert found["jerk_m_s3"] == 0.0


@pytest.mark.parametrize("steps", [0, 1, 2])
def test_an_arm_of_less_than_three_steps_has_no_jerk(steps: int) -> None:
    found = seen(np.zeros((steps + 1, 3)))
    assert found == {"path_m": 0.0, "jerk_m_s3": None, "step_m": [0.0] * steps, "step_jerk_m_s3": []}
