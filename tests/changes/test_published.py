from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.changes import SetSensorCorruption
from pytest_libero_max.changes.pixels import SensorCorruption
from pytest_libero_max.changes.published import PublishedSensorCorruption
from pytest_libero_max.worlds.contract import CAMERAS, Image
from pytest_libero_max.worlds.tiny import TinyWorld

EVENT = (24.0, 0.08, 2342431568)


def as_published(images: dict[str, Image], std: float, fraction: float, seed: int) -> dict[str, Image]:
    """One observation, worked out from the description: one stream, camera after camera."""
    stream, seen = np.random.RandomState(seed), {}
    for camera, image in images.items():
        work = image.astype(np.float32)
        work += stream.normal(0.0, std, size=work.shape)
        rows, columns = work.shape[:2]
        tall, wide = round(rows * fraction**0.5), round(columns * fraction**0.5)
        top = stream.randint(0, rows - tall + 1)
        left = stream.randint(0, columns - wide + 1)
        work[top : top + tall, left : left + wide] = 0
        seen[camera] = np.clip(work, 0, 255).astype(np.uint8)
    return seen


@pytest.mark.parametrize("step", [0, 1, 7])
@pytest.mark.parametrize("size", [16, 64])
def test_both_cameras_spend_one_stream(step: int, size: int) -> None:
    source = np.random.default_rng(1)
    images = {name: source.integers(0, 256, (size, size, 3), dtype=np.uint8) for name in CAMERAS}
    std, fraction, seed = EVENT
    expected = as_published(images, std, fraction, seed + step)
    for camera, image in images.items():
        seen = PublishedSensorCorruption(*EVENT)(image, camera, step)
        assert np.array_equal(seen, expected[camera]), camera


def test_other_cameras_are_left_alone() -> None:
    image = np.full((8, 8, 3), 100, dtype=np.uint8)
    assert np.array_equal(PublishedSensorCorruption(*EVENT)(image, "frontview", 0), image)


def test_a_world_says_which_noise_it_gets(monkeypatch: pytest.MonkeyPatch) -> None:
    world = TinyWorld()
    change = SetSensorCorruption(*EVENT)
    world.reset(0)
    change.apply(world)
    assert isinstance(world.filters[0][0], SensorCorruption)
    monkeypatch.setattr(TinyWorld, "semantics", "published")
    world.reset(0)
    change.apply(world)
    assert isinstance(world.filters[0][0], PublishedSensorCorruption)
