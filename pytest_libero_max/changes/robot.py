"""Changes of the robot: the pose of its arm, and a gripper that lets go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from pytest_libero_max.benchmark.structs import rule
from pytest_libero_max.changes.alteration import Alteration
from pytest_libero_max.changes.factors import Factor
from pytest_libero_max.changes.fields import between
from pytest_libero_max.changes.nothing import Indivisible
from pytest_libero_max.errors import ChangeError, counted
from pytest_libero_max.worlds.contract import AlterableWorld
from pytest_libero_max.worlds.robot import GRIPPER, ROBOT

_JointOffsets = Annotated[
    tuple[Annotated[float, between(-3.0, 3.0)], ...], rule("a list of at least one number", min_length=1)
]

_WAYS_OUT = (1.0, -1.0, 0.75, -0.75, 0.5, -0.5, 0.25, -0.25)


@dataclass(frozen=True)
class OffsetArm(Alteration):
    """Turn the arm's joints away from where they are; the arm then rests there, held by the controller."""

    operation: ClassVar[str] = "offset_arm"
    magnitudes = ("delta_joint_rad",)
    touched: ClassVar[frozenset[Factor]] = frozenset({"robot"})

    delta_joint_rad: _JointOffsets
    """Added to the joint positions, one for each joint of the arm, 7 for LIBERO's, rad."""
    keep_clear: bool | None = None
    """True: where the arm would touch something, the opposite offset is taken, and where that does too, three
    quarters of the one or the other, and so on. The evidence has the offset taken."""

    def _require(self, world: AlterableWorld) -> None:
        joints = len(world.arm_joints())
        if len(self.delta_joint_rad) != joints:
            raise ChangeError.seen(
                f"{self.operation}.delta_joint_rad",
                list(self.delta_joint_rad),
                f", but the arm of {world.scene} has {counted(joints, 'joint')}. Give one number for each.",
            )

    def _measure(self, world: AlterableWorld) -> dict[str, list[float]]:
        return {"joint_pos_rad": world.arm_joints().tolist(), "end_effector_m": world.end_effector().tolist()}

    def _alter(self, world: AlterableWorld) -> None:
        if not any(self.delta_joint_rad):
            return
        joints = world.arm_joints()
        for part in _WAYS_OUT:
            world.pose_arm(joints + part * np.array(self.delta_joint_rad))
            if not self.keep_clear or not _touching(world):
                return
        raise ChangeError(f"{self}: the arm touches something on every way there. Use a smaller offset.")


@dataclass(frozen=True)
class OpenGripper(Indivisible, Alteration):
    """Let the fingers open for a moment, whatever the policy commands.

    Their command becomes that of an open gripper. Actions that close it need eight steps (0.4 s) to bring it
    back, in which what was held falls.
    """

    operation: ClassVar[str] = "open_gripper"
    final: ClassVar[str] = "what was held has fallen."
    touched: ClassVar[frozenset[Factor]] = frozenset({"robot"})

    def _measure(self, world: AlterableWorld) -> dict[str, list[float]]:
        return {"finger_pos_m": world.fingers().tolist()}

    def _alter(self, world: AlterableWorld) -> None:
        world.open_gripper()


def _touching(world: AlterableWorld) -> bool:
    """Return True if the robot touches anything that has a name."""
    return any(
        {ROBOT, GRIPPER} & set(world.contacts(name)) for name in world.entities if name not in world.parked
    )
