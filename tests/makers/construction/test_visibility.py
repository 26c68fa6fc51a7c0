"""What the cameras show, counted in pixels."""

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.changes import ShiftCamera
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.makers.construction.preflight import preflight
from pytest_libero_max.makers.construction.visibility import MIN_PIXELS, Sight, look, pixels_of
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.makers.construction.test_preflight import case_of, move

AWAY = ShiftCamera("agentview", (0.0, 0.0, 0.0), 90.0, 0.0)


@pytest.fixture
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    world.reset(0)
    yield world
    world.close()


def test_pixels_are_those_that_differ_when_an_entity_is_gone(world: TinyWorld) -> None:
    pixels = world.visible_pixels("agentview", 256)["clutter_5"]
    before = world.observe(("agentview",), 256)["agentview_image"].astype(int)
    world.park("clutter_5", (-2.0, 0.0, -5.0))
    after = world.observe(("agentview",), 256)["agentview_image"].astype(int)
    changed = int((np.abs(before - after).max(axis=2) > 0).sum())
    assert "clutter_5" not in world.visible_pixels("agentview", 256)
    assert pixels <= changed <= 1.5 * pixels  # its rim is drawn half on a pixel, which segments do not count


def test_what_stands_in_front_hides(world: TinyWorld) -> None:
    camera = world.data.camera("agentview").xpos.copy()
    free = world.visible_pixels("agentview")["box_1"]
    world.place("clutter_1", camera + 0.6 * (world.position("box_1") - camera))
    assert world.visible_pixels("agentview").get("box_1", 0) < 0.2 * free


def test_looking_leaves_the_world_and_its_images_as_they_were(world: TinyWorld) -> None:
    digest = world.digest()
    image = world.observe(("agentview",), 64)["agentview_image"]
    world.visible_pixels("agentview", 64)
    assert world.digest() == digest
    assert (world.observe(("agentview",), 64)["agentview_image"] == image).all()


def test_a_camera_that_does_not_exist_is_named(world: TinyWorld) -> None:
    with pytest.raises(SubstrateError, match="camera='agentvew' does not exist"):
        world.visible_pixels("agentvew")


def test_a_camera_shift_out_of_view_is_kept_and_counted() -> None:
    world = TinyWorld()
    found = preflight(world, case_of("camera_shift", AWAY))
    assert found.passed
    (target,) = (sight for sight in found.sights if sight.role == "target")
    assert target.entity == "box_1"
    assert target.before[0] >= MIN_PIXELS > target.after[0]
    assert target.before[1] == target.after[1]


def test_any_other_event_may_hide_nothing() -> None:
    world = TinyWorld()
    reasons = [str(one) for one in preflight(world, move(0.06, 0.0)).problems]
    assert reasons == []

    class Covered(TinyWorld):
        """Nothing but the table is drawn once the box has moved."""

        def visible_pixels(self, camera: str, size: int = 256) -> dict[str, int]:
            seen = super().visible_pixels(camera, size)
            return seen if (self.position("box_1") == self.start).all() else {}

        start = world.position("box_1")

        def step(self, action: object) -> None:
            super().step(action)  # type: ignore[arg-type]
            self.start = self.position("box_1")

    found = preflight(Covered(), move(0.06, 0.0))
    assert "view" in {problem.check for problem in found.problems}


def test_seen_means_seen_by_any_camera() -> None:
    assert Sight("target", "milk_1", (MIN_PIXELS, 0), (0, MIN_PIXELS)).seen_after
    assert not Sight("target", "milk_1", (MIN_PIXELS, 0), (0, MIN_PIXELS - 1)).seen_after


def test_pixels_of_an_entity_are_in_the_order_of_the_cameras(world: TinyWorld) -> None:
    seen = look(world)
    assert pixels_of("box_1", seen) == (
        seen["agentview"]["box_1"],
        seen["robot0_eye_in_hand"].get("box_1", 0),
    )
    assert pixels_of("nothing", seen) == (0, 0)
