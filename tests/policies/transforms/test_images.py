from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.transforms import images
from pytest_libero_max.worlds.contract import Image


def picture(height: int = 6, width: int = 8) -> Image:
    return np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)


def marked(side: int = 256) -> Image:
    """Black with a red square in the first corner."""
    image = np.zeros((side, side, 3), dtype=np.uint8)
    image[: side // 8, : side // 8, 0] = 255
    return image


def test_a_rotation_brings_the_marked_corner_to_the_opposite_one_and_a_flip_to_the_one_below() -> None:
    rotated, flipped = images.rotate_180(marked()), images.flip_rows(marked())
    assert rotated[-1, -1, 0] == 255
    assert rotated[-1, 0, 0] == 0
    assert flipped[-1, 0, 0] == 255
    assert flipped[-1, -1, 0] == 0


def test_padding_keeps_the_proportions_in_the_middle() -> None:
    wide = np.full((100, 200, 3), 255, dtype=np.uint8)
    square = images.resize_with_pad(wide, 224)
    assert square.shape == (224, 224, 3)
    rows = np.flatnonzero(square[:, 112, 0])
    assert (rows[0], rows[-1]) == (56, 167)
    assert square[100].min() == 255


def test_an_odd_rest_is_rounded_down_above_and_on_the_left() -> None:
    tall = np.full((200, 101, 3), 255, dtype=np.uint8)
    columns = np.flatnonzero(images.resize_with_pad(tall, 100)[50, :, 0])
    assert (columns[0], columns[-1]) == (25, 74)


def test_an_image_of_the_right_size_stays_but_is_a_copy() -> None:
    image = picture(8, 8)
    same = images.resize_with_pad(image, 8)
    assert np.array_equal(same, image)
    assert not np.shares_memory(same, image)


def test_reducing_by_padding_is_antialiased_bilinear() -> None:
    # A fine checkerboard becomes grey; without antialiasing it would stay black and white.
    board = np.uint8(255) * (np.indices((256, 256)).sum(0) % 2).astype(np.uint8)
    image = np.repeat(board[:, :, None], 3, axis=2)
    inner = images.resize_with_pad(image, 64)[4:-4, 4:-4]
    assert 120 <= inner.min() <= inner.max() <= 136


@pytest.mark.parametrize(
    "resize", [images.resize_area, images.resize_bilinear, images.resize_bicubic, images.resize_lanczos]
)
def test_every_resize_keeps_the_corner_and_gives_the_size(resize: Callable[[Image, int], Image]) -> None:
    small = resize(marked(), 224)
    assert small.shape == (224, 224, 3)
    assert small.dtype == np.uint8
    assert small[5, 5, 0] > 250
    assert small[-5, -5].max() == 0


def test_area_is_the_mean_of_what_a_pixel_covers() -> None:
    image = picture(4, 4)
    mean = image.reshape(2, 2, 2, 2, 3).mean(axis=(1, 3))
    assert np.abs(images.resize_area(image, 2).astype(float) - mean).max() <= 0.5


def test_the_crop_has_the_share_of_the_area() -> None:
    assert images.centre_crop(picture(224, 224), 0.9).shape == (212, 212, 3)
    assert np.array_equal(images.centre_crop(picture(8, 8), 1.0), picture(8, 8))
    assert np.array_equal(images.centre_crop(picture(8, 8), 0.25), picture(8, 8)[2:6, 2:6])


def test_a_jpeg_round_trip_changes_little_and_not_nothing() -> None:
    rows, columns = np.indices((64, 64))
    smooth = np.stack([rows, columns, np.full((64, 64), 40)], axis=2)
    image = smooth.astype(np.uint8)
    after = images.jpeg_round_trip(image, 95)
    assert after.shape == image.shape
    difference = np.abs(after.astype(int) - image)
    assert 0 < difference.max() <= 6
    assert images.jpeg_round_trip(image, 20).tobytes() != after.tobytes()


def test_a_png_file_holds_every_pixel() -> None:
    import cv2

    decoded = cv2.imdecode(np.frombuffer(images.png_file(picture()), np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert np.array_equal(decoded[:, :, ::-1], picture())


def test_images_stand_side_by_side_from_left_to_right() -> None:
    left, right = picture(4, 3), picture(4, 5)
    both = images.side_by_side(left, right)
    assert np.array_equal(both[:, :3], left)
    assert np.array_equal(both[:, 3:], right)
    with pytest.raises(AdapterError, match="one height"):
        images.side_by_side(left, picture(5, 5))


def test_the_float_forms_have_their_ranges() -> None:
    ends = np.array([[[0, 255, 51]]], dtype=np.uint8)
    assert images.to_unit(ends).tolist() == [[[0.0, 1.0, np.float32(0.2)]]]
    assert images.to_signed(ends)[0, 0, :2].tolist() == [-1.0, 1.0]
    assert images.to_signed(ends).dtype == np.float32
    assert images.channels_first(picture(4, 5)).shape == (3, 4, 5)


@pytest.mark.parametrize(
    "piece",
    [
        images.rotate_180,
        images.flip_rows,
        images.jpeg_round_trip,
        images.png_file,
        images.to_unit,
        lambda image: images.resize_with_pad(image, 4),
        lambda image: images.resize_area(image, 4),
        lambda image: images.centre_crop(image, 0.9),
    ],
)
def test_no_piece_writes_to_its_image_or_takes_another_form(piece: Callable[[Image], object]) -> None:
    image = picture(8, 8)
    image.flags.writeable = False
    piece(image)
    for wrong in (image.astype(np.float32), image[:, :, 0], np.moveaxis(image, 2, 0)):
        with pytest.raises(AdapterError, match=r"\(H, W, 3\) uint8"):
            piece(wrong)  # type: ignore[arg-type]


def test_sizes_and_shares_that_mean_nothing_are_refused() -> None:
    with pytest.raises(AdapterError, match="side_px=0"):
        images.resize_with_pad(picture(), 0)
    with pytest.raises(AdapterError, match=r"share=1\.5"):
        images.centre_crop(picture(8, 8), 1.5)
    with pytest.raises(AdapterError, match="square"):
        images.centre_crop(picture(), 0.5)
    with pytest.raises(AdapterError, match="quality=0"):
        images.jpeg_round_trip(picture(), 0)
