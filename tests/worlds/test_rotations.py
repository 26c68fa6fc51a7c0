import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.rotations import Quaternion


@st.composite
def quaternions(draw: st.DrawFn) -> Quaternion:
    parts = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4))
    assume(math.hypot(*parts) > 0.1)
    return rotations.unit_by_hypot(rotations.quaternion(parts))


@given(quaternions(), quaternions())
def test_a_product_rotates_as_the_product_of_the_matrices(a: Quaternion, b: Quaternion) -> None:
    product = rotations.matrix(rotations.multiply(a, b))
    assert np.allclose(product, rotations.matrix(a) @ rotations.matrix(b), atol=1e-12)


@given(quaternions(), st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_a_vector_is_turned_as_by_the_matrix(q: Quaternion, vector: tuple[float, float, float]) -> None:
    assert np.allclose(rotations.rotate(q, vector), rotations.matrix(q) @ vector, atol=1e-12)


@given(quaternions(), st.floats(-180.0, 180.0))
def test_a_yaw_is_a_rotation_about_z(q: Quaternion, degrees: float) -> None:
    about = rotations.multiply(rotations.about((0.0, 0.0, 1.0), math.radians(degrees)), q)
    assert rotations.yawed(q, degrees) == about  # -0.0 == 0.0


@given(quaternions())
def test_the_axes_of_a_rotation_give_it_back(q: Quaternion) -> None:
    assume(abs(q[0]) > 0.01)
    back = np.array(rotations.of_axes(*rotations.matrix(q).T))
    assert np.allclose(back, q, atol=1e-9) or np.allclose(back, -np.array(q), atol=1e-9)


def test_a_half_turn_has_no_answer() -> None:
    with pytest.raises(ValueError, match="half turn"):
        rotations.of_axes((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))


@given(quaternions(), quaternions(), st.floats(0.0, 1.0))
def test_between_goes_along_the_shorter_arc(a: Quaternion, b: Quaternion, share: float) -> None:
    middle = rotations.between(a, b, share)
    whole = math.acos(min(1.0, abs(float(np.dot(a, b)))))
    assert math.acos(min(1.0, abs(float(np.dot(a, middle))))) == pytest.approx(share * whole, abs=1e-6)


@given(quaternions())
def test_the_three_lengths_differ_by_rounding_only(q: Quaternion) -> None:
    units = [rotations.unit_by_hypot(q), rotations.unit_by_squares(q), rotations.unit_fused(q)]
    for unit in units:
        assert np.allclose(unit, units[0], rtol=5e-16, atol=0.0)


def test_the_bits_of_the_three_lengths_are_frozen() -> None:
    """World digests of the frozen tracks contain each of them."""
    q = (0.84, 0.67, -0.94, 0.71)
    assert rotations.unit_by_hypot(q) == (
        0.5268347689090136,
        0.4202134466298085,
        -0.5895531937791342,
        0.4453008165778567,
    )
    assert rotations.unit_by_squares(q) == (
        0.5268347689090135,
        0.4202134466298084,
        -0.5895531937791342,
        0.44530081657785664,
    )
    assert rotations.unit_fused(q) == (
        0.5268347689090136,
        0.42021344662980853,
        -0.5895531937791343,
        0.44530081657785675,
    )


@given(
    quaternions(), quaternions(), st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.sampled_from([1.0, 1e-3, 1e-5])
)
def test_products_and_vectors_have_the_bits_of_scipys(
    a: Quaternion, b: Quaternion, vector: tuple[float, float, float], scale: float
) -> None:
    small = (vector[0] * scale, vector[1] * scale, vector[2] * scale)
    (one, other), turn = (scipys(a), scipys(b)), Rotation.from_rotvec(small)
    assert rotations.of_vector(small) == ours(turn)
    assert rotations.composed(ours(one), ours(other)) == ours(one * other)
    back = rotations.composed(ours(one), rotations.inverse(ours(other)))
    assert rotations.vector_of(back) == tuple((one * other.inv()).as_rotvec().tolist())
    assert rotations.composed(rotations.of_vector(small), ours(one)) == ours(turn * one)


def scipys(q: Quaternion) -> Rotation:
    return Rotation.from_quat([*q[1:], q[0]])


def ours(turn: Rotation) -> Quaternion:
    x, y, z, w = turn.as_quat().tolist()
    return w, x, y, z
