"""The arms with which robosuite's tasks are played, and the suites: the five tasks with one arm each.

Actions are those of robosuite's ``OSC_POSE``: a movement of the hand, then the gripper. robosuite's Panda is
LIBERO's robot, so that a policy for one may play the other.
"""

from __future__ import annotations

from types import MappingProxyType

from pytest_libero_max.benchmark.suites import Suite
from pytest_libero_max.worlds.robot import GRIPPER, PANDA, ROBOT, MujocoRobot, robosuite_state

BENCHMARK = "robosuite"

BUDGET = 400
"""Policy steps of an episode, as robomimic evaluates its policies on these tasks."""

UR5E = MujocoRobot(
    name="UR5e",
    state=robosuite_state(6, 6),
    arm_joints=tuple(
        f"{ROBOT}_{joint}_joint"
        for joint in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    ),
    finger_joints=(f"{GRIPPER}_finger_joint", f"{GRIPPER}_right_outer_knuckle_joint"),
    hand_body=f"{ROBOT}_right_hand",
)
"""Universal Robots' UR5e with the Robotiq 2F-85, whose fingers turn: their positions are angles, rad."""

SAWYER = MujocoRobot(
    name="Sawyer",
    state=robosuite_state(7, 2),
    arm_joints=tuple(f"{ROBOT}_right_j{number}" for number in range(7)),
    finger_joints=(f"{GRIPPER}_l_finger_joint", f"{GRIPPER}_r_finger_joint"),
    hand_body=f"{ROBOT}_right_hand",
)
"""Rethink's Sawyer with its own gripper."""

PANDA_TASKS = Suite("robosuite_panda", BUDGET, BENCHMARK, "panda", tasks=5)
UR5E_TASKS = Suite("robosuite_ur5e", BUDGET, BENCHMARK, "ur5e", tasks=5)
SAWYER_TASKS = Suite("robosuite_sawyer", BUDGET, BENCHMARK, "sawyer", tasks=5)

ROBOTS = MappingProxyType({PANDA_TASKS.name: PANDA, UR5E_TASKS.name: UR5E, SAWYER_TASKS.name: SAWYER})
"""The arm of each suite."""
