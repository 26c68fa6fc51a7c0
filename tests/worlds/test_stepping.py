from __future__ import annotations

from copy import copy
from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_libero_max.errors import SimulatorError, SubstrateError
from pytest_libero_max.policies.transforms.states import grip_site_quaternion, rotation_matrix
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.tasks.libero_tasks import SUITES, tasks
from pytest_libero_max.worlds.contract import Array, Control
from pytest_libero_max.worlds.robot import NOOP_ACTION
from pytest_libero_max.worlds.stepping import Stepper
from tests.worlds.reference import twin
from tests.worlds.states import integration_state, random_actions, random_poses

TASKS = [(suite, index) for suite in SUITES for index in range(0, len(tasks(suite)), 3)]


@cache
def _built(suite: str, index: int) -> EmbeddedWorld:
    return EmbeddedWorld(build_scene(suite, index))


def world_of(suite: str, index: int, init: int = 0) -> EmbeddedWorld:
    """The world of a scene, built once and reset."""
    _built(suite, index).reset(init)
    return _built(suite, index)


def assert_same_steps(world: EmbeddedWorld, env: Any, actions: Array) -> None:
    for number, action in enumerate(actions):
        env.step(action)
        world.step(action)
        ours, theirs = world.snapshot().physics, integration_state(env.sim.model._model, env.sim.data._data)
        assert np.array_equal(ours, theirs), f"step {number}: off by {np.abs(ours - theirs).max()}"
        robot = env.robots[0]
        assert np.array_equal(world.snapshot().controller[:9], np.ravel(robot.controller.goal_ori))
        assert np.array_equal(world.snapshot().controller[9:], robot.gripper.current_action)


@pytest.mark.parametrize(("suite", "index"), TASKS)
def test_a_step_has_the_bits_of_robosuites_own(suite: str, index: int) -> None:
    world = world_of(suite, index, index % 10)
    assert_same_steps(world, twin(build_scene(suite, index), world), random_actions(index, 8))


@pytest.mark.parametrize(("suite", "index"), [("libero_spatial", 5), ("libero_object", 2)])
def test_equal_bits_last(suite: str, index: int) -> None:
    world = world_of(suite, index)
    assert_same_steps(world, twin(build_scene(suite, index), world), random_actions(7, 80))


def test_equal_bits_in_the_middle_of_things() -> None:
    """The arm runs into the table, with its controller in a state that no reset gives."""
    world = world_of("libero_spatial", 0)
    for _ in range(25):
        world.step((0.2, 0.0, -1.0, 0.0, 0.1, 0.0, 1.0))
    assert "gripper0" in world.contacts("main_table")
    assert world.snapshot().controller[9:].any()
    assert_same_steps(world, twin(build_scene("libero_spatial", 0), world), random_actions(3, 20))


@pytest.mark.parametrize(("suite", "index"), [("libero_spatial", 5), ("libero_object", 2)])
def test_poses_have_the_bits_of_robosuites_own_control_with_use_delta_off(suite: str, index: int) -> None:
    world = world_of(suite, index)
    for _ in range(3):
        world.step(NOOP_ACTION)
    env = twin(build_scene(suite, index), world)
    world.set_control("absolute")
    env.robots[0].controller.use_delta = False
    began = world.end_effector()
    assert_same_steps(world, env, random_poses(began, index, 12))
    assert np.linalg.norm(world.end_effector() - began) > 0.02


def test_under_absolute_control_the_hand_goes_where_it_is_told() -> None:
    world = world_of("libero_spatial", 0)
    goal, turn = world.end_effector() + np.array([0.06, -0.04, -0.05]), (0.3, 3.0, 0.1)
    world.set_control("absolute")
    for _ in range(40):
        world.step((*goal, *turn, -1.0))
    seen = world.observe(())
    assert seen["robot0_eef_pos"] == pytest.approx(goal, abs=5e-3)
    matrix = rotation_matrix(grip_site_quaternion(seen["robot0_eef_quat"]))
    assert matrix == pytest.approx(Rotation.from_rotvec(turn).as_matrix(), abs=0.05)


def test_the_goal_of_any_action_has_the_bits_of_robosuites_own() -> None:
    from robosuite.utils.control_utils import set_goal_orientation  # imported quietly by the world's modules

    world = world_of("libero_object", 1)
    stepper, controller = world._stepper, world._env.robots[0].controller
    draw = np.random.default_rng(0)
    for number in range(400):
        action = draw.uniform(-1.5, 1.5, 7)
        match number % 5:
            case 0:
                action[3:6] = (0.0, -0.0, 0.0)
            case 1:
                action[3:6] *= 1e-9
            case 2:
                action = np.sign(action)
            case 3:
                action[draw.integers(7)] = 0.0
        now = np.linalg.qr(draw.normal(size=(3, 3)))[0]
        world.data.site_xmat[world._grip_site] = now.ravel()
        delta = controller.scale_action(action[:6])
        orientation = stepper.state()[:9].reshape(3, 3)
        if any(delta[3:]):
            orientation = set_goal_orientation(delta[3:], now)
        goal = stepper.aim(action)
        assert goal.tobytes() == (world.data.site_xpos[world._grip_site] + delta[:3]).tobytes()
        assert stepper.state()[:9].tobytes() == np.ascontiguousarray(orientation).tobytes()


@pytest.mark.parametrize(
    ("value", "message"),
    [(np.nan, "no longer finite"), (1e12, "no longer finite|moves at"), (2e4, "no longer finite|moves at")],
)
def test_numerical_trouble_is_seen_in_the_step_in_which_it_comes(value: float, message: str) -> None:
    world = world_of("libero_object", 1)
    world.step(NOOP_ACTION)
    world.data.qvel[-4] = value  # of the last object, upwards
    with pytest.raises(SimulatorError, match=message):
        world.step(NOOP_ACTION)


def test_matrices_of_the_arm_that_are_not_finite_end_the_episode() -> None:
    world = world_of("libero_object", 1)
    for field in ("qM", "qvel"):
        state = world.snapshot()
        getattr(world.data, field)[:] = np.nan
        with pytest.raises(SimulatorError, match=r"invert|no longer finite"):
            world.step(NOOP_ACTION)
        world.restore(state)
    world.step(NOOP_ACTION)


def test_derived_data_belong_to_the_end_of_the_step() -> None:
    world = world_of("libero_object", 1)
    for action in random_actions(0, 5):
        world.step(action)
    fresh = copy(world.data)
    mujoco.mj_forward(world.model, fresh)
    for field in ("xpos", "xquat", "site_xpos", "cam_xpos", "geom_xpos", "qfrc_bias", "qM"):
        assert np.array_equal(getattr(world.data, field), getattr(fresh, field)), field
    assert world.data.ncon == fresh.ncon
    assert np.array_equal(world.data.contact.geom, fresh.contact.geom)
    assert np.array_equal(world.data.contact.dist, fresh.contact.dist)


@pytest.mark.parametrize("control", ["delta", "absolute"])
def test_a_restored_world_continues_with_the_same_bits(control: Control) -> None:
    world = world_of("libero_spatial", 3)
    for action in random_actions(1, 7):
        world.step(action)
    world.set_control(control)
    state, futures = world.snapshot(), []
    actions = random_actions(2, 10) if control == "delta" else random_poses(world.end_effector(), 2, 10)
    for _ in range(2):
        digests = []
        for action in actions:
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
    env = twin(build_scene("libero_object", 1), world_of("libero_object", 1))
    setattr(env.robots[0].controller, attribute, value)
    with pytest.raises(SubstrateError, match=message):
        Stepper(env)
