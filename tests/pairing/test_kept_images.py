from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.pairing import kept_images
from pytest_libero_max.pairing.kept_images import KeptImages
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION
from tests.pairing.actors import Looking

KEYS = [f"{camera}_image" for camera in CAMERAS]


def test_a_state_is_drawn_once_and_shown_as_often_as_asked() -> None:
    world, images = Looking(), KeptImages()
    first = world.snapshot()
    shown = images.observe(world, CAMERAS, 32)
    for key in KEYS:
        shown[key][:] = 0  # a policy may write to what it is shown
    world.step(NOOP_ACTION)
    later = images.observe(world, CAMERAS, 32)
    world.restore(first)
    drawn = world.images
    again, fresh = images.observe(world, CAMERAS, 32), Looking().observe(CAMERAS, 32)
    assert world.images == drawn == 4
    assert list(again) == list(fresh) == list(later)
    assert all(np.array_equal(again[key], fresh[key]) for key in fresh)
    again[KEYS[0]][:] = 0
    assert np.array_equal(images.observe(world, CAMERAS, 32)[KEYS[0]], fresh[KEYS[0]])


def test_another_state_camera_or_size_is_drawn() -> None:
    world, images = Looking(), KeptImages()
    assert not [key for key in images.observe(world, (), 32) if key.endswith("_image")]
    assert world.images == 0
    for number, (cameras, size) in enumerate([(CAMERAS[:1], 32), (CAMERAS[1:], 32), (CAMERAS[:1], 16)], 1):
        image = images.observe(world, cameras, size)[f"{cameras[0]}_image"]
        assert image.shape == (size, size, 3)
        assert world.images == number
    world.alter("light_diffuse", 0, (0.1, 0.1, 0.1))
    images.observe(world, CAMERAS[:1], 32)
    assert world.images == 4


def test_the_oldest_images_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_images, "KEPT_BYTES", 2 * 32 * 32 * 3)
    world, images = Looking(), KeptImages()
    states = []
    for _ in range(3):
        states.append(world.snapshot())
        images.observe(world, CAMERAS[:1], 32)
        world.step(NOOP_ACTION)
    for state, drawn in ((states[2], 3), (states[1], 3), (states[0], 4)):
        world.restore(state)
        images.observe(world, CAMERAS[:1], 32)
        assert world.images == drawn
