"""Robots: what actions and observations mean, and the names that the parts of one have in a compiled model.

A policy names its robot (:attr:`.PolicySpec.robot`), a world has one (:attr:`.World.robot`), and both must be
the same. Another package adds its own, a :class:`.contract.Robot`, by an entry point
(``pytest_libero_max.robots``).

On MuJoCo and robosuite a :class:`MujocoRobot` also names joints and bodies. What still follows from the
Panda:

- ``worlds/stepping``, ``worlds/robosuite_world`` and ``substrates/embedded`` take :data:`PANDA`, and so do
  the experts, ``makers/construction`` and ``lab/demos``;
- absolute control, and a robot that waits for an answer under it, have LIBERO's seven components
  (``policies/check``, ``pairing/rollout``); ``policies/transforms/states`` has the quarter turn from the
  observed hand to the grip site;
- times of latency are steps of 50 ms (``runs/protocol``, ``runs/query_times``);
- ``policies/model_inputs`` guesses the inputs of a model from LIBERO's two cameras.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.registry import Registry, given
from pytest_libero_max.worlds.contract import Robot

ROBOT, GRIPPER, MOUNT = "robot0", "gripper0", "mount0"
"""robosuite's names of a scene's only robot, its gripper and what it stands on; the names of their bodies
begin so. ``World.contacts`` reports arm and mount as ``robot0``, the gripper as ``gripper0``."""

OWNERS = MappingProxyType({f"{ROBOT}_": ROBOT, f"{MOUNT}_": ROBOT, f"{GRIPPER}_": GRIPPER})
"""Names under which contacts of the robot's bodies are reported, by the beginning of the bodies' names."""


@dataclass(frozen=True, kw_only=True)
class MujocoRobot(Robot):
    """An arm with a gripper, by the names that its parts have in a compiled model."""

    arm_joints: tuple[str, ...]
    """From the base to the hand."""
    finger_joints: tuple[str, ...]
    """One for each finger. The finger is the body that the joint moves, with everything that is fixed to
    it."""
    hand_body: str
    """Body whose orientation is observed."""
    grip_site: str = f"{GRIPPER}_grip_site"
    """Site between the fingers: the end effector."""
    base_body: str = f"{ROBOT}_base"
    """Body that the arm stands on."""
    controller: str = "OSC_POSE"
    """Robosuite's name of its controller."""
    home_rad: tuple[float, ...] = ()
    """Angles of the arm's joints at the start of LIBERO's tasks, rad."""
    finger_start: Mapping[str, float] = field(default_factory=dict)
    """Positions of the fingers' joints there, m."""


def robosuite_state(arm_joints: int, fingers: int) -> dict[str, int]:
    """Return robosuite's keys of a robot's state, with the sizes of their arrays."""
    return {
        f"{ROBOT}_eef_pos": 3,
        f"{ROBOT}_eef_quat": 4,
        f"{ROBOT}_gripper_qpos": fingers,
        f"{ROBOT}_gripper_qvel": fingers,
        f"{ROBOT}_joint_pos": arm_joints,
        f"{ROBOT}_joint_vel": arm_joints,
    }


PANDA = MujocoRobot(
    name="Panda",
    state=robosuite_state(7, 2),
    arm_joints=tuple(f"{ROBOT}_joint{number}" for number in range(1, 8)),
    finger_joints=(f"{GRIPPER}_finger_joint1", f"{GRIPPER}_finger_joint2"),
    hand_body=f"{ROBOT}_right_hand",
    home_rad=(0.0, -0.161037389, 0.0, -2.44459747, 0.0, 2.2267522, 0.7853981633974483),
    finger_start={f"{GRIPPER}_finger_joint1": 0.020833, f"{GRIPPER}_finger_joint2": -0.020833},
)
"""The Franka Emika Panda with its own gripper, as robosuite 1.4 models it."""


def _accept(name: str, candidate: object) -> Robot:
    if not isinstance(candidate, Robot):
        raise ValueError(f"{candidate!r} is no pytest_libero_max.worlds.contract.Robot")
    return candidate


ROBOTS: Registry[Robot] = Registry(
    "robot", "pytest_libero_max.robots", given("name", PANDA), _accept, SubstrateError, attribute="name"
)
"""Every robot that a policy may name: LIBERO's Panda, then those that installed packages add."""
