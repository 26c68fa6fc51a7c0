from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.joints import Joints, by_joint


def joints(nq: int, nv: int, **spans: tuple[int, int, int, int]) -> Joints:
    return Joints(nq, nv, spans)


def test_states_go_to_the_joints_of_their_names() -> None:
    """A slide and a free joint; the other scene has them the other way round, and a hinge between them."""
    source = joints(8, 7, drawer=(0, 1, 0, 1), bowl=(1, 8, 1, 7))
    target = joints(9, 8, bowl=(0, 7, 0, 6), occluder=(7, 8, 6, 7), drawer=(8, 9, 7, 8))
    states = np.arange(32.0).reshape(2, 16)
    start = np.full(18, -1.0)
    adapted = by_joint(states, source, target, start)
    for row, state in zip(adapted, states, strict=True):
        assert row[0] == state[0]
        assert row[1:8].tolist() == state[2:9].tolist()
        assert row[9] == state[1]
        assert row[10:16].tolist() == state[10:16].tolist()
        assert row[17] == state[9]
        assert row[8] == row[16] == -1.0


@pytest.mark.parametrize(
    "target", [joints(7, 6, bowl=(0, 7, 0, 6)), joints(8, 7, bowl=(0, 7, 0, 6), drawer=(7, 8, 6, 6))]
)
def test_a_joint_that_is_lacking_or_of_another_kind_is_an_error(target: Joints) -> None:
    source = joints(8, 7, drawer=(0, 1, 0, 1), bowl=(1, 8, 1, 7))
    with pytest.raises(SubstrateError, match="joint 'drawer'"):
        by_joint(np.zeros((1, 16)), source, target, np.zeros(1 + target.nq + target.nv))


def test_states_of_another_scene_are_an_error() -> None:
    source = joints(8, 7, drawer=(0, 1, 0, 1), bowl=(1, 8, 1, 7))
    with pytest.raises(SubstrateError, match=r"17 numbers, .* 16"):
        by_joint(np.zeros((1, 17)), source, source, np.zeros(16))
