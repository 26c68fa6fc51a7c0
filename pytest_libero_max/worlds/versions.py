"""Versions that results stand for, and known differences with others."""

from __future__ import annotations

import re

REFERENCE = "MuJoCo 3.2.6 and robosuite 1.4"
"""Versions that the benchmark's authors ran."""

PICTURES = (
    "MuJoCo draws textures tagged as sRGB darker from 3.3.3 on. Our pictures are those of the reference "
    "all the same; those of LIBERO's own renderer are not."
)


def version_notes(mujoco: str, robosuite: str) -> list[str]:
    """Known changes of results with these versions; none within this package's own bounds.

    Args:
        mujoco: For example ``3.3.7``.
        robosuite: For example ``1.4.1``.
    """
    notes = []
    if is_later_line(mujoco):
        notes.append(
            f"MuJoCo {mujoco} computes contacts of boxes as from 3.4.0 on, and LIBERO's objects are made of "
            f"boxes: outcomes differ from the reference ({REFERENCE}). Use mujoco>=3.3.6,<3.4, which has no "
            "wheel for Python 3.14."
        )
    elif _parts(mujoco) < (3, 3, 6):
        notes.append(
            f"MuJoCo {mujoco}, like all before 3.3.6, moves the solver's warm start in every forward pass. "
            "Our stepping does fewer of them, so its bits are not the package's. Use mujoco>=3.3.6,<3.4."
        )
    if not (1, 4) <= _parts(robosuite) < (1, 5):
        notes.append(f"robosuite {robosuite} is not of the 1.4 line, on which LIBERO runs.")
    return notes


def is_later_line(mujoco: str) -> bool:
    """Return True from 3.4.0 on, where boxes touch in another way; False where no version is known."""
    return _parts(mujoco) >= (3, 4)


def _parts(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])
