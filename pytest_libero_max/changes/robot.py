"""Changes of the robot: where its arm starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pytest_libero_max.changes.base import Evidence, Factor
from pytest_libero_max.changes.fields import ManifestFields, items, number, strength_of
from pytest_libero_max.worlds.contract import World

ARM_DOF = 7


@dataclass(frozen=True)
class OffsetArm(ManifestFields):
    """Turn the arm's joints away from where they are; the arm is at rest there and the controller holds it.

    Attributes:
        delta_joint_rad: (7,) added to the joint positions, rad.

    Raises:
        ChangeError: A value breaks its rule.
    """

    operation: ClassVar[str] = "offset_arm"

    delta_joint_rad: tuple[float, ...]

    def __post_init__(self) -> None:
        where = "offset_arm.delta_joint_rad"
        given = items(where, self.delta_joint_rad, ARM_DOF)
        delta = tuple(number(f"{where}[{i}]", part, -3.0, 3.0) for i, part in enumerate(given))
        self._set("delta_joint_rad", delta)

    @property
    def factors(self) -> frozenset[Factor]:
        return frozenset({"robot"})

    def apply(self, world: World) -> Evidence:
        before = _measure(world)
        if any(self.delta_joint_rad):
            joints = world.observe(cameras=())["robot0_joint_pos"]
            world.pose_arm(joints + np.array(self.delta_joint_rad))
        return Evidence(self.operation, tuple(sorted(self.factors)), before, _measure(world))

    def scaled(self, strength: float) -> OffsetArm:
        """Every joint's offset multiplied by ``strength``."""
        s = strength_of(self.operation, strength)
        return self if s == 1.0 else OffsetArm(tuple(delta * s for delta in self.delta_joint_rad))


def _measure(world: World) -> dict[str, list[float]]:
    joints = world.observe(cameras=())["robot0_joint_pos"]
    return {"joint_pos_rad": joints.tolist(), "end_effector_m": world.end_effector().tolist()}
