from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.substrates.embedded import textures
from pytest_libero_max.substrates.embedded.labels import Label, box_atlas
from pytest_libero_max.substrates.embedded.meshes import FACES
from pytest_libero_max.worlds.contract import Image

MATERIALS = [textures.wood, textures.plaster, textures.tiles, textures.wicker]


@given(st.integers(0, 1000), st.sampled_from([1, 2, 8]))
def test_noise_is_a_function_of_its_seed_and_stays_in_range(seed: int, cell: int) -> None:
    first, second = textures.noise(16, 32, seed, cell), textures.noise(16, 32, seed, cell)
    assert (first == second).all()
    assert first.min() >= 0
    assert first.max() <= 1
    assert (first != textures.noise(16, 32, seed + 1, cell)).any()


def test_noise_tiles() -> None:
    field = textures.noise(64, 64, 3, 16)
    inner = np.abs(np.diff(field, axis=1)).max()
    assert np.abs(field[:, 0] - field[:, -1]).max() <= inner


@pytest.mark.parametrize("material", MATERIALS)
def test_materials_are_pictures_with_a_pattern(material: Callable[[], Image]) -> None:
    picture = material()
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    assert picture.std() > 2
    assert (picture == material()).all()


def test_upload_writes_a_picture_bottom_row_first_where_its_name_says() -> None:
    model = mujoco.MjModel.from_xml_string("""
      <mujoco><asset>
        <texture name="a" type="2d" builtin="flat" width="4" height="4" rgb1="1 1 1"/>
        <texture name="b" type="2d" builtin="flat" width="3" height="2" rgb1="1 1 1"/>
      </asset></mujoco>""")
    picture = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    textures.upload(model, {"b": picture})
    start = model.tex_adr[model.texture("b").id]
    assert (model.tex_data[start : start + 18].reshape(2, 3, 3) == picture[::-1]).all()
    assert (model.tex_data[: 4 * 4 * 3] == 255).all()


def test_shapes_cover_what_they_should() -> None:
    label = Label((0, 0, 0), 100, 50)
    label.block(0.0, 0.0, 0.5, 1.0, (255, 0, 0)).disc(0.75, 0.5, 0.1, (0, 255, 0)).polygon(
        [(0.0, 0.0), (0.2, 0.0), (0.0, 0.4)], (0, 0, 255)
    )
    assert tuple(label.image[25, 40]) == (255, 0, 0)
    assert tuple(label.image[25, 75]) == (0, 255, 0)
    assert tuple(label.image[2, 2]) == (0, 0, 255)
    assert tuple(label.image[5, 95]) == (0, 0, 0)
    discs = (label.image[..., 1] > 127).sum()
    assert discs == pytest.approx(np.pi * 10**2, rel=0.05)


def test_what_lies_outside_the_picture_is_cut_off() -> None:
    label = (
        Label((9, 9, 9), 32, 32)
        .disc(1.5, 0.5, 0.2, (255, 0, 0))
        .word("MILK", 0.0, 0.5, 0.5, 0.5, (0, 255, 0))
    )
    assert (label.image[:, 20:] == 9).all()
    assert (label.image[:, :8, 1] == 255).any()


def test_words_are_told_apart() -> None:
    drawn = {
        word: Label((0, 0, 0), 64, 16).word(word, 0.5, 0.5, 1, 1, (255,) * 3).image
        for word in ("MILK", "SOUP")
    }
    assert np.abs(drawn["MILK"].astype(int) - drawn["SOUP"]).mean() > 20


def test_a_letter_stands_upright() -> None:
    image = Label((0, 0, 0), 50, 70).word("L", 0.5, 0.5, 1, 1, (255,) * 3).image
    assert image[35, 3, 0] == 255
    assert image[66, 45, 0] == 255
    assert image[20, 45, 0] == 0


def test_the_atlas_puts_each_picture_into_its_cell() -> None:
    faces = {face: textures.plain((20 * n, 0, 0), 30, 50) for n, face in enumerate(FACES)}
    atlas = box_atlas(faces, cell=16)
    assert atlas.shape == (32, 48, 3)
    assert [int(atlas[16 * (n // 3) + 8, 16 * (n % 3) + 8, 0]) for n in range(6)] == [0, 20, 40, 60, 80, 100]
