"""Worlds of robosuite's tasks: its own bits, states that are values, initial states by index, spares."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import SETTLE_STEPS
from pytest_libero_max.errors import AdapterError, SubstrateError
from pytest_libero_max.events.approach import hold
from pytest_libero_max.lab.robosuite.expert import RobosuiteExpert
from pytest_libero_max.lab.robosuite.robots import BUDGET, ROBOTS
from pytest_libero_max.lab.robosuite.substrate import RobosuiteSubstrate
from pytest_libero_max.lab.robosuite.tasks import SPARES
from pytest_libero_max.lab.robosuite.world import INITS, TaskWorld
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.lab.robosuite.every_task import differing_step, diverging_step

SUITES = [*ROBOTS]


@pytest.fixture(scope="module")
def substrate() -> Iterator[RobosuiteSubstrate]:
    opened = RobosuiteSubstrate()
    yield opened
    opened.close()


@pytest.fixture(params=enumerate(SUITES), ids=SUITES)
def world(request: pytest.FixtureRequest, substrate: RobosuiteSubstrate) -> TaskWorld:
    """A world of each arm, of another task each."""
    number, suite = request.param
    return substrate.task_world(suite, number)


def test_a_step_has_the_bits_of_robosuites_own(world: TaskWorld) -> None:
    assert differing_step(world, init=1, steps=6) is None


def test_a_restored_world_continues_with_the_same_bits(world: TaskWorld) -> None:
    assert diverging_step(world, steps=8) is None


def test_it_observes_the_keys_of_its_robot(world: TaskWorld) -> None:
    world.reset(0)
    assert {key: value.size for key, value in world.observe(()).items()} == world.robot.state
    theirs = world._env._get_observations(force_update=True)
    for key, value in world.observe(()).items():
        if key != "robot0_joint_pos":
            assert np.array_equal(value, theirs[key]), key


def test_an_initial_state_depends_on_its_index_alone(world: TaskWorld) -> None:
    world.reset(3)
    digest = world.digest()
    world._starts.clear()
    np.random.seed(7)  # noqa: NPY002 - robosuite draws from it
    world.reset(4)
    assert world.digest() != digest
    world.reset(3)
    assert world.digest() == digest
    drawn = np.random.random()  # noqa: NPY002
    np.random.seed(7)  # noqa: NPY002
    assert np.random.random() == drawn  # noqa: NPY002
    for init in (-1, INITS):
        with pytest.raises(SubstrateError, match="init"):
            world.reset(init)


def test_spares_wait_out_of_the_scene_and_stand_where_they_are_brought(substrate: RobosuiteSubstrate) -> None:
    world = substrate.task_world("robosuite_panda", 0)
    world.reset(0)
    assert set(SPARES) <= set(world.parked)
    target = world.position("cube")
    height = world.parked_pose("spare_1")[0][2]
    world.unpark("spare_1", (target[0] + 0.14, target[1], height))
    for _ in range(20):
        world.step(world.robot.noop)
    assert world.position("spare_1") == pytest.approx((target[0] + 0.14, target[1], height), abs=2e-3)
    assert world.contacts("spare_1") == ("table",)


def test_the_expert_solves_a_task_with_each_arm(world: TaskWorld) -> None:
    world.reset(0)
    hold(world, SETTLE_STEPS)
    policy = RobosuiteExpert()
    policy.reset(Episode("robosuite_panda", 0, world.language, 195, BUDGET, world=world, robot=world.robot))
    for number in range(BUDGET // policy.spec.query_interval):
        digest = world.digest()
        actions = policy.predict({}, Query(number, number, world.language, 0))
        assert world.digest() == digest
        for action in actions[: policy.spec.query_interval]:
            world.step(action)
            if world.succeeded():
                return
    pytest.fail(f"{world.scene} is not solved in {BUDGET} steps")


def test_the_expert_refuses_other_worlds() -> None:
    with pytest.raises(AdapterError, match="--libero-max-substrate=robosuite"):
        RobosuiteExpert().reset(Episode("robosuite_panda", 0, "", 195, BUDGET, world=TinyWorld()))
