from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.worlds.rendering.renderer import OFFSAMPLES, Renderer
from pytest_libero_max.worlds.robot import CAMERAS
from tests.scripts.measure import make_case

CASE = make_case("libero_spatial", 0, 0)


@pytest.mark.parametrize(("images", "samples"), [("1", OFFSAMPLES), ("2", 0)])
def test_a_version_is_a_number_of_samples(images: str, samples: int) -> None:
    substrate = EmbeddedSubstrate(images=images)
    world = substrate.world(CASE)
    world.reset(0)
    drawer = Renderer(world.model, world.data, samples=samples)
    shown = world.observe(CAMERAS, 128)
    for camera in CAMERAS:
        assert np.array_equal(shown[f"{camera}_image"], drawer.render(camera, 128))
    drawer.close()
    substrate.close()


def test_a_version_of_images_alters_pixels_alone() -> None:
    first, second = EmbeddedSubstrate(images="1"), open_substrate("embedded")
    worlds = [substrate.world(CASE) for substrate in (first, second)]
    for world in worlds:
        world.reset(0)
    images = [world.observe(("agentview",), 128)["agentview_image"].astype(int) for world in worlds]
    different = np.abs(images[0] - images[1]).max(axis=2) > 0
    assert 0 < different.mean() < 0.2
    assert worlds[0].digest() == worlds[1].digest()
    assert worlds[0].scene_fields() == worlds[1].scene_fields()
    prints = [dict(substrate.fingerprint(images=True)) for substrate in (first, second)]
    assert [each.pop("images") for each in prints] == ["1", "2"]
    assert prints[0] == prints[1]
    assert "images" not in second.fingerprint()
    first.close()
    second.close()
