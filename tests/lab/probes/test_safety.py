"""Forces and torques of the probe ``safety`` against what mechanics says."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from pytest_libero_max.lab.probes.safety import loads
from pytest_libero_max.worlds.robot import PANDA, MujocoRobot

GRAVITY = 9.81


def world(
    xml: str, steps: int = 0, ctrl: float = 0.0, velocity: float = 0.0, robot: MujocoRobot = PANDA
) -> Any:
    """A world of one body ``box`` (the entity) and bodies of a robot, after some steps."""
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option timestep='0.002' gravity='0 0 -{GRAVITY}'/><worldbody>{xml}</worldbody>"
        f"<actuator><motor joint='{robot.arm_joints[0]}'/></actuator></mujoco>"
    )
    data = mujoco.MjData(model)
    data.ctrl[:] = ctrl
    data.qvel[0] = velocity
    for _ in range(steps):
        mujoco.mj_step(model, data)
    boxes = np.array([number for number in range(model.ngeom) if model.geom(number).name == "box"])
    return SimpleNamespace(model=model, data=data, geoms={"box": boxes}.__getitem__, robot=robot)


ARM = """<body name='robot0_link1' pos='5 0 0'><joint name='robot0_joint1' axis='0 0 1' damping='1'/>
<geom size='.05' mass='1'/></body>"""
RESTING = """<body name='robot0_hand'><geom type='box' size='.2 .2 .02'/></body>
<body pos='0 0 .07'><freejoint/><geom name='box' type='box' size='.05 .05 .05' mass='2'/></body>"""


def test_a_mass_at_rest_presses_with_its_weight() -> None:
    still = world(RESTING + ARM, steps=1000)
    found = loads(still, ["box"])
    assert found.goal_n == pytest.approx(2 * GRAVITY, rel=1e-3)
    assert (found.surroundings_n, found.itself) == (0.0, False)
    assert loads(still, []).surroundings_n == pytest.approx(2 * GRAVITY, rel=1e-3)


def test_a_push_at_a_steady_speed_presses_with_friction() -> None:
    """A hand that moves at 0.2 m/s pushes a box over a floor: the force is friction times weight."""
    pushing = world(
        """<geom type='plane' size='5 5 .1' friction='.5 .005 .0001' priority='1'/>
        <body name='robot0_hand' pos='-.1 0 .05' gravcomp='1'><joint name='slide' type='slide' axis='1 0 0'/>
        <geom type='sphere' size='.04' mass='1000' contype='2' conaffinity='2' friction='0 0 0' priority='2'/>
        </body>
        <body pos='0 0 .05'><freejoint/>
        <geom name='box' type='box' size='.05 .05 .05' mass='2' contype='3' conaffinity='3'/></body>"""
        + ARM,
        steps=500,
        velocity=0.2,
    )
    assert pushing.data.qvel[0] == pytest.approx(0.2, rel=0.1)
    forces = []
    for _ in range(500):  # the box leaves the hand and is caught up with, again and again
        mujoco.mj_step(pushing.model, pushing.data)
        forces.append(loads(pushing, ["box"]).goal_n)
    assert np.mean(forces) == pytest.approx(0.5 * 2 * GRAVITY, rel=0.05)


def test_the_torque_is_that_of_the_motor() -> None:
    assert loads(world(ARM, ctrl=-5.0), []).torque_nm == 5.0


def test_another_robot_has_forces_and_torques_by_the_names_of_its_parts() -> None:
    robot = replace(PANDA, name="other", owners={"arm:*": "robot0"}, arm_joints=("arm:joint1",))
    lying = (RESTING + ARM).replace("robot0_", "arm:")
    measured = loads(world(lying, steps=1000, ctrl=-5.0, robot=robot), ["box"])
    assert measured.goal_n == pytest.approx(2 * GRAVITY, rel=1e-3)
    assert measured.torque_nm == 5.0


def test_a_robot_that_presses_against_itself_is_seen() -> None:
    folded = RESTING.replace("<body pos='0 0 .07'>", "<body name='gripper0_finger' pos='0 0 .07'>")
    found = loads(world(folded + ARM, steps=1000), [])
    assert (found.itself, found.surroundings_n) == (True, 0.0)


def test_fingers_that_close_on_each_other_are_no_contact_of_the_robot_with_itself() -> None:
    closed = RESTING.replace("robot0_hand", "gripper0_leftfinger")
    closed = closed.replace("<body pos='0 0 .07'>", "<body name='gripper0_rightfinger' pos='0 0 .07'>")
    found = loads(world(closed + ARM, steps=1000), [])
    assert (found.itself, found.surroundings_n) == (False, 0.0)


def test_the_world_is_left_as_it_is() -> None:
    still = world(RESTING + ARM, steps=1000)
    forces, contacts = still.data.efc_force.tobytes(), still.data.contact.dist.tobytes()
    loads(still, ["box"])
    assert (still.data.efc_force.tobytes(), still.data.contact.dist.tobytes()) == (forces, contacts)
