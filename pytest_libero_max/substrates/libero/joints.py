"""Initial states of one scene for another with more joints, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.worlds.contract import Array


@dataclass(frozen=True)
class Joints:
    """Addresses of a compiled scene's joints."""

    nq: int
    nv: int
    spans: Mapping[str, tuple[int, int, int, int]]
    """By joint name the first and the last but one of its positions and of its velocities."""

    @classmethod
    def of(cls, model: Any) -> Joints:
        """Return the joints of a ``mujoco.MjModel``."""
        positions = [*model.jnt_qposadr.tolist(), model.nq]
        velocities = [*model.jnt_dofadr.tolist(), model.nv]
        spans = {
            model.joint(number).name: (*positions[number : number + 2], *velocities[number : number + 2])
            for number in range(model.njnt)
        }
        return cls(model.nq, model.nv, spans)


def by_joint(states: Array, source: Joints, target: Joints, start: Array) -> Array:
    """Convert initial states of one scene to another that has more joints.

    Args:
        states: (n, 1 + nq + nv) of the first.
        start: (1 + nq + nv,) of the other: values of the joints that only it has.

    Raises:
        SubstrateError: The states are not the first scene's, or the other lacks one of its joints or has it
            of another kind.
    """
    if states.shape[1] != 1 + source.nq + source.nv:
        raise SubstrateError(
            f"An initial state has {counted(states.shape[1], 'number')}, but its scene has "
            f"{1 + source.nq + source.nv} (time, positions and velocities). Restore both from one release."
        )
    adapted = np.tile(start, (len(states), 1))
    adapted[:, 0] = states[:, 0]
    for name, (low, high, first, last) in source.spans.items():
        there = target.spans.get(name, (0, 0, 0, 0))
        if (there[1] - there[0], there[3] - there[2]) != (high - low, last - first):
            raise SubstrateError(
                f"The initial states hold the joint {name!r}, which the scene that they are for lacks or has "
                "of another kind. Restore both from one release."
            )
        adapted[:, 1 + there[0] : 1 + there[1]] = states[:, 1 + low : 1 + high]
        adapted[:, 1 + target.nq + there[2] : 1 + target.nq + there[3]] = states[
            :, 1 + source.nq + first : 1 + source.nq + last
        ]
    return adapted
