"""Robots: what actions and observations mean, and the names that the parts of one have in a compiled model.

A policy names its robot (:attr:`.PolicySpec.robot`), a world has one (:attr:`.World.robot`), and both must be
the same. Another package adds its own :class:`Robot` by an entry point
(``pytest_libero_max.robots``).

On MuJoCo and robosuite a :class:`MujocoRobot` also names joints and bodies. What still follows from the
Panda:

- ``substrates/embedded`` takes :data:`PANDA`, and so do the experts, ``makers/construction`` and
  ``lab/demos``;
- ``policies/transforms/states`` has the quarter turn from the observed hand to the grip site, with which a
  robot of seven components waits for an answer under absolute control (``pairing/rollout``);
- ``policies/model_inputs`` guesses the inputs of a model from LIBERO's two cameras.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from types import MappingProxyType
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.registry import Registry, given

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

ROBOT, GRIPPER, MOUNT = "robot0", "gripper0", "mount0"
"""robosuite's names of a scene's only robot, its gripper and what it stands on; the names of their bodies
begin so. ``World.contacts`` reports arm and mount as ``robot0``, the gripper as ``gripper0``."""

OWNERS = MappingProxyType({f"{ROBOT}_*": ROBOT, f"{MOUNT}_*": ROBOT, f"{GRIPPER}_*": GRIPPER})
"""Names under which contacts of the robot's bodies are reported, by shell patterns of the bodies' names."""

CONTROL_HZ = 20
"""Control steps in a second of LIBERO's robot; that of a world is ``world.robot.control_hz``."""
MOST_HZ = 1000
ACTION_DIM = 7
ORIENTATION_KEY = f"{ROBOT}_eef_quat"
"""Key of the orientation (4, xyzw) of the hand of robosuite's robots."""
NOOP_ACTION = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0)
"""Hold the pose with the gripper open: LIBERO's settle action."""

CAMERAS = ("agentview", "robot0_eye_in_hand")
"""The two cameras a LIBERO policy sees, in the order in which LIBERO lists them."""


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot as a policy knows it: the meaning and the number of what goes in and out.

    Raises:
        ValueError: A value breaks its rule.
    """

    name: str
    """Name of the robot, by which policies and profiles name it."""
    noop: tuple[float, ...] = NOOP_ACTION
    """Action that holds the pose with the gripper open; its length is that of every action."""
    control_hz: int = CONTROL_HZ
    """Control steps in a second of simulated time."""
    cameras: tuple[str, ...] = CAMERAS
    """Cameras of a policy, the main one first, then that at the hand if there is one."""
    state: Mapping[str, int] = field(default_factory=dict, hash=False)
    """Keys of an observation besides the images, with the sizes of their arrays."""
    joints_key: str = "robot0_joint_pos"
    """Key of the positions of the arm's joints, rad."""
    fingers_key: str = "robot0_gripper_qpos"
    """Key of the positions of the fingers, m."""

    def __post_init__(self) -> None:
        if not self.name or not self.noop or not self.cameras:
            raise ValueError(f"{self!r}: a robot has a name, components of an action and a camera")
        if not isinstance(self.control_hz, int) or not 1 <= self.control_hz <= MOST_HZ:
            raise ValueError(f"control_hz={self.control_hz!r} of {self.name!r}, but must be 1 to {MOST_HZ}")

    @property
    def components(self) -> int:
        """Number of components of an action."""
        return len(self.noop)

    @property
    def opening(self) -> float:
        """Sign of the last component of an action that opens the gripper: that of the no-op; -1 on LIBERO."""
        return 1.0 if self.noop[-1] > 0 else -1.0

    def closes(self, action: Sequence[float] | NDArray[np.float64]) -> bool:
        """Return True if an action closes the gripper."""
        return bool(action[-1] * self.opening < 0)


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
    reach_m: float = 0.80
    """Horizontal distance from that body within which an event may put a target or a receptacle, m; by
    default about that of the farthest target in LIBERO's own tasks, with the tool pointing down."""
    owners: Mapping[str, str] = field(default_factory=lambda: OWNERS, hash=False)
    """Names under which contacts of its bodies are reported, ``robot0`` or ``gripper0``, by shell patterns
    (``robot0_*``) of the bodies' names; the first that fits counts."""
    controller: str = "OSC_POSE"
    """Robosuite's name of its controller."""
    home_rad: tuple[float, ...] = ()
    """Angles of the arm's joints at the start of LIBERO's tasks, rad."""
    finger_start: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Positions of the fingers' joints there, m."""

    def owner_of(self, body: str) -> str | None:
        """Return the name under which contacts of a body are reported; None for a body of something else."""
        return next((owner for pattern, owner in self.owners.items() if fnmatchcase(body, pattern)), None)


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
        raise ValueError(f"{candidate!r} is no pytest_libero_max.Robot")
    return candidate


ROBOTS: Registry[Robot] = Registry(
    "robot", "pytest_libero_max.robots", given("name", PANDA), _accept, SubstrateError, attribute="name"
)
"""Every robot that a policy may name: LIBERO's Panda, then those that installed packages add."""
