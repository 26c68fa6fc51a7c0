from __future__ import annotations

from copy import copy
from typing import Any

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.embedded.scene import build_scene
from pytest_libero_max.worlds.embedded.substrate import EmbeddedWorld
from pytest_libero_max.worlds.embedded.tasks import SUITES, tasks
from pytest_libero_max.worlds.stepping import Stepper
from tests.worlds.reference import twin
from tests.worlds.states import integration_state, random_actions

TASKS = [(suite, index) for suite in SUITES for index in range(len(tasks(suite)))]


def assert_same_steps(world: EmbeddedWorld, env: Any, seed: int, count: int) -> None:
    for number, action in enumerate(random_actions(seed, count)):
        env.step(action)
        world.step(action)
        ours, theirs = world.snapshot().physics, integration_state(env.sim.model._model, env.sim.data._data)
        assert np.array_equal(ours, theirs), f"step {number}: off by {np.abs(ours - theirs).max()}"
        robot = env.robots[0]
        assert np.array_equal(world.snapshot().controller[:9], np.ravel(robot.controller.goal_ori))
        assert np.array_equal(world.snapshot().controller[9:], robot.gripper.current_action)


@pytest.mark.parametrize(("suite", "index"), TASKS)
def test_a_step_has_the_bits_of_robosuites_own(suite: str, index: int) -> None:
    scene = build_scene(suite, index)
    world = EmbeddedWorld(scene)
    world.reset(index % 10)
    assert_same_steps(world, twin(scene, world), index, 8)


@pytest.mark.parametrize(("suite", "index"), [("libero_spatial", 5), ("libero_object", 2)])
def test_equal_bits_last(suite: str, index: int) -> None:
    scene = build_scene(suite, index)
    world = EmbeddedWorld(scene)
    assert_same_steps(world, twin(scene, world), 7, 80)


def test_equal_bits_in_the_middle_of_things() -> None:
    """The arm runs into the table, with its controller in a state that no reset gives."""
    scene = build_scene("libero_spatial", 0)
    world = EmbeddedWorld(scene)
    for _ in range(25):
        world.step((0.2, 0.0, -1.0, 0.0, 0.1, 0.0, 1.0))
    assert "gripper0" in world.contacts("main_table")
    assert world.snapshot().controller[9:].any()
    assert_same_steps(world, twin(scene, world), 3, 20)


def test_derived_data_belong_to_the_end_of_the_step() -> None:
    world = EmbeddedWorld(build_scene("libero_object", 1))
    for action in random_actions(0, 5):
        world.step(action)
    fresh = copy(world.data)
    mujoco.mj_forward(world.model, fresh)
    for field in ("xpos", "xquat", "site_xpos", "cam_xpos", "geom_xpos", "qfrc_bias", "qM"):
        assert np.array_equal(getattr(world.data, field), getattr(fresh, field)), field
    assert world.data.ncon == fresh.ncon
    assert np.array_equal(world.data.contact.geom, fresh.contact.geom)
    assert np.array_equal(world.data.contact.dist, fresh.contact.dist)


def test_a_restored_world_continues_with_the_same_bits() -> None:
    world = EmbeddedWorld(build_scene("libero_spatial", 3))
    for action in random_actions(1, 7):
        world.step(action)
    state, futures = world.snapshot(), []
    for _ in range(2):
        digests = []
        for action in random_actions(2, 10):
            world.step(action)
            digests.append(world.digest())
        futures.append(digests)
        world.reset(4)
        world.restore(state)
    assert futures[0] == futures[1]


@pytest.mark.parametrize(
    ("attribute", "value", "message"),
    [
        ("impedance_mode", "variable", r"controller.impedance_mode='variable'.*'fixed'"),
        ("position_limits", np.zeros((2, 3)), r"(?s)controller.position_limits=array.*None"),
    ],
)
def test_a_controller_that_is_not_reproduced_is_refused(attribute: str, value: Any, message: str) -> None:
    scene = build_scene("libero_object", 0)
    env = twin(scene, EmbeddedWorld(scene))
    setattr(env.robots[0].controller, attribute, value)
    with pytest.raises(SubstrateError, match=message):
        Stepper(env)
