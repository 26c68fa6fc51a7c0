"""The five corruptions of a picture, and the glare."""

import numpy as np
import pytest

from pytest_libero_max.changes import Glare, PictureCorruption, image_corruptions
from pytest_libero_max.worlds.contract import Image

KINDS = sorted(image_corruptions.KINDS)
rows, columns = np.mgrid[0:64, 0:64]
PICTURE = np.stack([(rows * 5) % 256, (columns * 7) % 256, (rows * columns) % 256], axis=2).astype(np.uint8)


def corrupted(
    kind: str,
    level: int = 5,
    seed: int = 1,
    camera: str = "agentview",
    step: int = 0,
    blend: float = 1.0,
    image: Image = PICTURE,
) -> Image:
    return PictureCorruption(kind, level, seed, "agentview", blend)(image, camera, step)


@pytest.mark.parametrize("kind", KINDS)
def test_a_corruption_keeps_shape_and_type_and_leaves_its_input_alone(kind: str) -> None:
    before = PICTURE.copy()
    image = corrupted(kind)
    assert image.shape == PICTURE.shape
    assert image.dtype == np.uint8
    assert np.array_equal(PICTURE, before)
    assert not np.array_equal(image, PICTURE)


@pytest.mark.parametrize("kind", KINDS)
def test_a_corruption_is_a_function_of_its_arguments(kind: str) -> None:
    assert np.array_equal(corrupted(kind, step=3), corrupted(kind, step=3))


@pytest.mark.parametrize("kind", ["motion_blur", "fog", "glass_blur"])
def test_what_is_drawn_differs_from_step_to_step_and_seed_to_seed(kind: str) -> None:
    assert not np.array_equal(corrupted(kind, step=3), corrupted(kind, step=4))
    assert not np.array_equal(corrupted(kind, seed=1), corrupted(kind, seed=2))


@pytest.mark.parametrize("kind", KINDS)
def test_the_other_camera_stays_clean(kind: str) -> None:
    assert corrupted(kind, camera="robot0_eye_in_hand") is PICTURE


@pytest.mark.parametrize("kind", KINDS)
def test_a_high_level_is_farther_from_the_picture_than_a_low_one(kind: str) -> None:
    checks = np.kron(np.indices((8, 8)).sum(axis=0) % 2, np.ones((32, 32)))
    image = np.repeat((checks * 200 + 20).astype(np.uint8)[..., None], 3, axis=2)

    def away(level: int) -> float:
        looks = [corrupted(kind, level, step=step, image=image) for step in range(3)]
        return float(np.mean([np.abs(look.astype(float) - image).mean() for look in looks]))

    assert away(10) > 1.2 * away(1)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "fog"])
def test_blurs_leave_an_even_picture_even(kind: str) -> None:
    even = np.full((48, 48, 3), 90, np.uint8)
    assert np.abs(corrupted(kind, 10, image=even).astype(int) - 90).max() <= 1


def test_a_blend_lies_between_the_clean_and_the_corrupted_picture() -> None:
    half, full = corrupted("gaussian_blur", blend=0.5), corrupted("gaussian_blur")
    middle = (PICTURE.astype(float) + full) / 2
    assert np.abs(half - middle).max() <= 1.0


def test_gaussian_blur_spreads_a_point_by_its_deviation() -> None:
    point = np.zeros((256, 256, 3))
    point[128, 128] = 1.0
    soft = image_corruptions.focus(point, 6, np.random.RandomState(0))[..., 0]
    spread = np.sqrt((soft * (np.arange(256) - 128.0) ** 2).sum() / soft.sum())
    assert spread == pytest.approx(6.0, rel=0.02)


def test_zoom_blur_keeps_the_middle_and_averages_as_many_pictures_as_its_table_says() -> None:
    image = np.random.RandomState(0).random_sample((65, 65, 3))
    zoomed = image_corruptions.zoom(image, 1, np.random.RandomState(0))
    assert np.allclose(zoomed[32, 32], image[32, 32])
    line = np.zeros((65, 65, 3))
    line[:, 0] = 1.0  # the left edge leaves the picture at every factor above 1
    shares = image_corruptions.zoom(line, 1, np.random.RandomState(0))[:, 0, 0]
    assert 2 / 12 <= shares[32] < 0.7


def test_glass_only_moves_pixels_about() -> None:
    image = np.random.RandomState(0).random_sample((40, 40, 3))
    rough = image_corruptions.glass(image, 1, np.random.RandomState(1))
    assert rough.mean() == pytest.approx(image.mean(), abs=0.01)


def test_plasma_fills_the_range_and_tiles() -> None:
    field = image_corruptions.plasma(64, 2.0, np.random.RandomState(3))
    assert (field.min(), field.max()) == (0.0, 1.0)
    across_the_seam = np.abs(field[:, 0] - field[:, -1]).mean()
    inside = np.abs(np.diff(field, axis=1)).mean()
    assert across_the_seam < 3 * inside


def test_fog_follows_its_published_mix() -> None:
    image = np.full((32, 32, 3), 0.5)
    stream = np.random.RandomState(5)
    clouds = image_corruptions.plasma(32, 3.0, np.random.RandomState(5))
    assert np.allclose(image_corruptions.fog(image, 1, stream)[..., 0], (0.5 + 0.5 * clouds) * 0.5 / 1.0)


def test_glare_whitens_its_middle_and_spares_the_far_corner() -> None:
    image = np.full((100, 100, 3), 40, np.uint8)
    veiled = Glare(1.0, 0.75, 0.75, 0.2)(image, "agentview", 0)
    assert veiled[75, 75].min() > 250
    assert np.abs(veiled[0, 0].astype(int) - 40).max() <= 1
    assert (veiled >= image).all()
