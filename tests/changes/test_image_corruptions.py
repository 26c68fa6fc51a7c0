"""The five corruptions of a picture, and the glare."""

import hashlib

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pytest_libero_max.changes import Glare, PictureCorruption, image_corruptions, image_loops
from pytest_libero_max.changes.pixels import PublishedSensorCorruption
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.robot import CAMERAS

KINDS = sorted(image_corruptions.KINDS)
rows, columns = np.mgrid[0:64, 0:64]
PICTURE = np.stack([(rows * 5) % 256, (columns * 7) % 256, (rows * columns) % 256], axis=2).astype(np.uint8)

rows, columns = np.mgrid[0:256, 0:256]
LARGE = np.stack([(rows * 5) % 256, (columns * 7) % 256, (rows * columns) % 256], axis=2).astype(np.uint8)

# SHA-256, first eight digits, of LARGE at levels 1 to 10. Published outcomes rest on these pictures.
DIGESTS = {
    "motion_blur": "f431657a 8ed507b9 a6d6626a 036e5d72 4dd50d75 e9422159 d8167ee1 e1b3b62f df5ca78b"
    " 3d361784",
    "gaussian_blur": "5eb6b4e8 07080a8a dc931849 b4bd9005 df69d89d 2a8785bb 99702b3d c9a9fcce 1439b298"
    " 3de33a7c",
    "zoom_blur": "faedc64e cc5954bb 6d5487cc 76e2eba1 54c8dfb2 58926cf9 c60637c5 b173d825 f9b1d795 66e921aa",
    "fog": "012d0837 68ac2791 0c76790f 65659fa3 a4588569 965a7aac 5af8dbaa 7ece6f90 0ccbc146 d8c62a4f",
    "glass_blur": "fa4a3af3 b171485e 351dc874 866769fa 8f012282 fe3b1426 575148fb 32454088 a4e25d41 7aeeecd4",
}


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


@pytest.mark.parametrize("kind", KINDS)
def test_every_level_gives_the_picture_that_published_runs_saw(kind: str) -> None:
    looks = [corrupted(kind, level, seed=3, step=2, image=LARGE) for level in range(1, 11)]
    assert [hashlib.sha256(look.tobytes()).hexdigest()[:8] for look in looks] == DIGESTS[kind].split()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (9, 7), (40, 75)])
def test_images_of_any_size_and_in_any_order_of_memory_are_corrupted(
    kind: str, shape: tuple[int, int]
) -> None:
    image = np.ascontiguousarray(LARGE[: shape[0], 100 : 100 + shape[1]])
    flipped = image[::-1, ::-1].copy()[::-1, ::-1]
    for level in (1, 5, 10):
        assert np.array_equal(corrupted(kind, level, image=image), corrupted(kind, level, image=flipped))


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (9, 70), (33, 20)])
@pytest.mark.parametrize("level", [1, 4, 10])
def test_compiled_loops_have_the_bits_of_the_whole_array_formulas(shape: tuple[int, int], level: int) -> None:
    image = np.random.RandomState(level).random_sample((*shape, 3))
    height, width = shape
    down, across = np.arange(-3, 7), np.arange(10)
    weights = np.random.RandomState(1).random_sample(10)
    smeared = np.zeros_like(image)
    for y, x, weight in zip(down, across, weights, strict=True):
        rows = (np.arange(height) + y).clip(0, height - 1)
        smeared += weight * image[rows][:, (np.arange(width) + x).clip(0, width - 1)]
    padded = np.empty((height, (width + 9) * 3))
    result = np.empty_like(image)
    image_loops.smear(image, down, across, weights, padded, result)
    assert np.array_equal(result, smeared)

    deviation = 0.4 * level
    blurred = gaussian_filter(image, (deviation, deviation, 0.0), mode="nearest")
    assert np.array_equal(image_corruptions._gaussian(image, deviation), blurred)

    factors = [1.0, 1.01, 1.3, 1.56]
    total = image.copy()
    for factor in factors:
        enlarged = image
        for axis, size in enumerate(shape):
            (low,), (part,) = image_corruptions._lines(size, [factor])
            part = part[:, None, None] if axis == 0 else part[None, :, None]
            high = np.minimum(low + 1, size - 1)
            enlarged = enlarged.take(low, axis) * (1.0 - part) + enlarged.take(high, axis) * part
        total += enlarged
    tables = [image_corruptions._lines(size, factors) for size in shape]
    wide = np.empty((height, width + 1, 4))
    image_loops.zoomed(image, *tables[0], *tables[1], wide, result)
    assert np.array_equal(result, total / 5)


@pytest.mark.parametrize("shape", [(64, 64, 3), (5, 5, 3)])
def test_published_noise_of_a_camera_is_the_same_alone_and_after_the_other(shape: tuple[int, ...]) -> None:
    image = np.full(shape, 120, np.uint8)
    noise = PublishedSensorCorruption(25.0, 0.1, 4)
    alone = noise(image, CAMERAS[1], 9)
    noise(image, CAMERAS[0], 8)
    noise(image, CAMERAS[0], 9)
    assert np.array_equal(noise(image, CAMERAS[1], 9), alone)
    stream = np.random.RandomState(13)
    for _ in CAMERAS:
        drawn = stream.normal(0.0, 25.0, size=shape)
        side = round(shape[0] * 0.1**0.5)
        top, left = (stream.randint(shape[0] - side + 1) for _ in range(2))
    wanted = image.astype(np.float32)
    wanted += drawn
    wanted[top : top + side, left : left + side] = 0.0
    assert np.array_equal(alone, wanted.clip(0, 255).astype(np.uint8))
