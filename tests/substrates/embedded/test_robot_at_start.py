"""The robot at reset: it touches nothing, and its grip site is turned against its hand as adapters expect."""

from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.policies.transforms.states import grip_site_quaternion, rotation_matrix
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld

from .scenes import ALL, IDS


@pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)
def test_the_robot_starts_clear_of_everything(suite: str, index: int) -> None:
    world = EmbeddedWorld(build_scene(suite, index))
    try:
        for name in world.entities:
            assert not {"robot0", "gripper0"} & set(world.contacts(name)), name
    finally:
        world.close()


def test_the_observed_orientation_of_the_hand_leads_to_that_of_the_grip_site() -> None:
    world = EmbeddedWorld(build_scene("libero_object", 0))
    try:
        world.reset(0)
        hand = world.observe(())["robot0_eef_quat"]
        site = world.data.site("gripper0_grip_site").xmat.reshape(3, 3)
        assert np.allclose(rotation_matrix(grip_site_quaternion(hand)), site, atol=1e-9)
    finally:
        world.close()
