"""The robot among the things: at reset it touches nothing."""

from __future__ import annotations

import pytest

from pytest_libero_max.worlds.embedded.scene import build_scene
from pytest_libero_max.worlds.embedded.substrate import EmbeddedWorld

from .scenes import ALL, IDS


@pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)
def test_the_robot_starts_clear_of_everything(suite: str, index: int) -> None:
    world = EmbeddedWorld(build_scene(suite, index))
    try:
        for name in world.entities:
            assert not {"robot0", "gripper0"} & set(world.contacts(name)), name
    finally:
        world.close()
