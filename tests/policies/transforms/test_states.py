from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.transforms import states

PARTS = st.floats(-1.0, 1.0).filter(lambda value: abs(value) > 1e-3)
QUATERNIONS = st.tuples(PARTS, PARTS, PARTS, PARTS).map(lambda q: np.array(q) / np.linalg.norm(q))


@given(QUATERNIONS)
@settings(max_examples=30)
def test_both_rules_give_the_same_rotation_and_only_one_keeps_the_angle_below_pi(q: states.Array) -> None:
    kept, antipodal = states.axis_angle(q), states.axis_angle_antipodal(q)
    for vector in (kept, antipodal):
        assert np.allclose(Rotation.from_rotvec(vector).as_matrix(), Rotation.from_quat(q).as_matrix())
    assert np.linalg.norm(antipodal) <= math.pi + 1e-9
    assert (np.linalg.norm(kept) > math.pi) == (q[3] < 0.0)


def test_no_rotation_is_zero_and_a_number_beyond_one_is_cut() -> None:
    assert states.axis_angle(np.array([0.0, 0.0, 0.0, 1.0])).tolist() == [0.0, 0.0, 0.0]
    assert states.axis_angle(np.array([0.0, 0.0, 0.0, 1.0000001])).tolist() == [0.0, 0.0, 0.0]


@given(QUATERNIONS)
@settings(max_examples=30)
def test_columns_and_rows_are_those_of_the_rotation_matrix(q: states.Array) -> None:
    matrix = Rotation.from_quat(q).as_matrix()
    assert np.allclose(states.rotation_matrix(q), matrix)
    assert np.allclose(states.rotation_6d_columns(q), [*matrix[:, 0], *matrix[:, 1]])
    assert np.allclose(states.rotation_6d_rows(q), [*matrix[0], *matrix[1]])


@given(QUATERNIONS)
@settings(max_examples=10)
def test_the_grip_site_is_a_quarter_turn_from_the_hand(q: states.Array) -> None:
    expected = Rotation.from_quat(q) * Rotation.from_rotvec([0.0, 0.0, -math.pi / 2])
    found = Rotation.from_quat(states.grip_site_quaternion(q))
    assert np.allclose(found.as_matrix(), expected.as_matrix())


def test_sine_and_cosine_take_turns() -> None:
    values = np.array([0.0, math.pi / 2], dtype=np.float32)
    result = states.sine_cosine(values)
    assert np.allclose(result, [0.0, 1.0, 1.0, 0.0], atol=1e-6)
    assert result.dtype == np.float32


def test_zeros_follow_and_more_values_than_places_are_refused() -> None:
    assert states.pad_to(np.array([1.0, 2.0]), 4).tolist() == [1.0, 2.0, 0.0, 0.0]
    assert states.first(np.array([1.0, 2.0]), 1).tolist() == [1.0]
    assert states.entry(np.array([1.0, 2.0]), 1).tolist() == [2.0]
    with pytest.raises(AdapterError, match="no entry 2"):
        states.entry(np.array([1.0, 2.0]), 2)
    with pytest.raises(AdapterError, match="padded to 1"):
        states.pad_to(np.array([1.0, 2.0]), 1)
    with pytest.raises(AdapterError, match="fewer than the 3"):
        states.first(np.array([1.0, 2.0]), 3)


def test_a_quaternion_has_four_numbers_and_is_not_written_to() -> None:
    q = np.array([0.1, 0.2, 0.3, -1.1])
    before = q.copy()
    states.axis_angle(q)
    states.axis_angle_antipodal(q)
    assert np.array_equal(q, before)
    with pytest.raises(AdapterError, match=r"\(4,\)"):
        states.axis_angle(np.zeros(3))
    with pytest.raises(AdapterError, match="no rotation"):
        states.rotation_matrix(np.zeros(4))
