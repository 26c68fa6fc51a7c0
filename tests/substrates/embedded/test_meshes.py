from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.substrates.embedded.meshes import FACES, Mesh, atlas_cell, box, join, panel, revolve

lengths = st.floats(0.01, 1.0)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def assert_normals_agree(mesh: Mesh) -> None:
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    geometric = np.cross(b - a, c - a)
    solid = np.linalg.norm(geometric, axis=1) > 1e-12
    for k in range(3):
        assert (np.einsum("ij,ij->i", geometric, mesh.normals[mesh.triangles[:, k]])[solid] > 0).all()


@given(lengths, lengths, lengths)
def test_a_plain_box_encloses_its_volume(x: float, y: float, z: float) -> None:
    mesh = box((x, y, z))
    assert volume(mesh) == pytest.approx(8 * x * y * z)
    assert_normals_agree(mesh)


@given(lengths, lengths, lengths, st.floats(0.001, 0.009))
def test_a_chamfered_box_is_closed_and_a_little_smaller(x: float, y: float, z: float, chamfer: float) -> None:
    mesh = box((x, y, z), chamfer)
    inner = 8 * (x - chamfer) * (y - chamfer) * (z - chamfer)
    assert inner < volume(mesh) < 8 * x * y * z
    assert mesh.vertices.max(axis=0) == pytest.approx([x, y, z])
    assert len(mesh.triangles) == 6 * 2 + 12 * 2 + 8
    assert_normals_agree(mesh)


def test_each_face_of_a_box_shows_its_own_cell_of_the_atlas() -> None:
    mesh = box((1, 2, 3))
    for number, face in enumerate(FACES):
        u0, v0, u1, v1 = atlas_cell(face)
        u, v = mesh.texcoords[4 * number : 4 * number + 4].T
        assert (u > u0).all()
        assert (u < u1).all()
        assert (v > v0).all()
        assert (v < v1).all()


def test_the_front_label_reads_from_left_to_right_for_the_camera_in_front() -> None:
    mesh = box((1, 1, 1))
    front = mesh.vertices[:4]
    left, right = front[mesh.texcoords[:4, 0].argmin()], front[mesh.texcoords[:4, 0].argmax()]
    assert left[1] < right[1]  # the camera looks along -x, where +y is to the right
    assert front[mesh.texcoords[:4, 1].argmax()][2] == 1


@given(lengths, lengths, st.integers(8, 40))
def test_a_revolved_cylinder_encloses_its_prism(radius: float, height: float, segments: int) -> None:
    mesh = revolve([(0, 0), (radius, 0), (radius, height), (0, height)], segments)
    prism = segments * radius**2 * math.sin(2 * math.pi / segments) / 2 * height
    assert volume(mesh) == pytest.approx(prism)
    assert_normals_agree(mesh)


def test_a_bend_is_smooth_below_the_crease_angle_and_sharp_above() -> None:
    smooth = revolve([(1, 0), (1.1, 1), (1.1, 2)], 8)
    sharp = revolve([(1, 0), (2, 0.5), (1, 1)], 8)
    assert len(smooth.vertices) == 3 * 9
    assert len(sharp.vertices) == 4 * 9


def test_a_label_around_a_bottle_faces_the_camera_with_its_middle() -> None:
    mesh = revolve([(1, 0), (1, 1)], 16)
    middle = mesh.vertices[np.isclose(mesh.texcoords[:, 0], 0.5)]
    assert middle[:, 0] == pytest.approx(1)


def test_scaling_keeps_normals_at_right_angles_to_the_surface() -> None:
    mesh = revolve([(1, 0), (2, 1)], 12).moved(scale=(0.3, 1, 2))
    assert_normals_agree(mesh)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1)


def test_joining_keeps_every_triangle_where_it_was() -> None:
    one, two = panel([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), box((1, 1, 1))
    both = join(one, two)
    corners = both.vertices[both.triangles[1:]]
    assert (corners == two.vertices[two.triangles]).all()
