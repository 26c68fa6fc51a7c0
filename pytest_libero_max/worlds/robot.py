"""The robot of a world: the names of its parts and the numbers that are its own, in one place.

A world of another robot needs another :class:`Robot`. Which controller drives it is a matter of the world:
:mod:`.stepping` reproduces robosuite's ``OSC_POSE`` and reads gains, limits and indices from the environment.
"""

from __future__ import annotations

from dataclasses import dataclass

ROBOT, GRIPPER, MOUNT = "robot0", "gripper0", "mount0"
"""robosuite's names of a scene's only robot, its gripper and what it stands on; the names of their bodies
begin so. ``World.contacts`` reports arm and mount as ``robot0``, the gripper as ``gripper0``."""

OWNERS = {f"{ROBOT}_": ROBOT, f"{MOUNT}_": ROBOT, f"{GRIPPER}_": GRIPPER}
"""What the bodies of the robot belong to, by the beginning of their names."""


@dataclass(frozen=True)
class Robot:
    """An arm with a gripper, by the names that its parts have in a compiled model.

    Attributes:
        finger_joints: One for each finger. The finger is the body that the joint moves, with everything that
            is fixed to it.
    """

    finger_joints: tuple[str, ...]


PANDA = Robot(finger_joints=(f"{GRIPPER}_finger_joint1", f"{GRIPPER}_finger_joint2"))
"""The Franka Emika Panda with its own gripper, as robosuite 1.4 models it."""
