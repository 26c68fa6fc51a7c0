"""The robot of a world: the names of its parts and the numbers that are its own, in one place.

Another robot needs another :class:`Robot`, and these, which follow from no name:

- whatever takes :data:`PANDA`: ``worlds/stepping``, ``worlds/robosuite_world``, ``changes/robot`` (number of
  joints), ``makers/construction/preflight`` (base), ``policies/clients/request`` (keys of observations),
  ``experts/scene_view`` (parts by name) and the substrates;
- a control step: :mod:`.stepping` reproduces robosuite's ``OSC_POSE`` for any arm and gripper that robosuite
  drives with it, and checks the number of joints; gains, limits and indices come from the environment;
- actions: seven components, six of the hand and one of the gripper (``ACTION_DIM`` in ``worlds/contract``);
- observations: ``robot0_gripper_qpos`` has two fingers in ``films/replay``, ``policies/server/vla_eval``,
  ``lab/servo`` and ``demos/lerobot``, which also writes the robot's name; ``policies/transforms/states``
  has the quarter turn from the observed hand to the grip site;
- its visuals on the embedded scenes (:mod:`pytest_libero_max.substrates.embedded.panda`);
- initial states: the embedded ones start from :attr:`Robot.home_rad`, LIBERO's are files of the Panda;
- the experts, which grasp with two fingers, and whatever a policy has learnt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

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
