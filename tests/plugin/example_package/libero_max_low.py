"""A trigger in a package of its own: the hand is low over the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pytest_libero_max import Moment, Trigger
from pytest_libero_max.errors import ManifestError


@dataclass(frozen=True)
class HandBelow(Trigger):
    """The first step that leaves the end effector below a height.

    Attributes:
        height_m: In the world frame, in m.
    """

    type: ClassVar[str] = "hand_below"

    height_m: float

    def __post_init__(self) -> None:
        if not isinstance(self.height_m, int | float):
            raise ManifestError(f"hand_below.height_m={self.height_m!r}, but must be a height in metres.")

    def fires(self, moment: Moment) -> bool:
        return moment.step > 0 and float(moment.world.end_effector()[2]) < self.height_m
