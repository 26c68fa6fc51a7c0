from __future__ import annotations

import gc
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import SimulatorError, SubstrateError
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.mujoco_world import MujocoWorld
from pytest_libero_max.worlds.rendering import renderer
from pytest_libero_max.worlds.rendering.renderer import Renderer, require_images
from pytest_libero_max.worlds.robot import NOOP_ACTION

RED = 0


@dataclass(frozen=True)
class Stamp:
    """Write 100 and the step into the first pixel."""

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        stamped = image.copy()
        stamped[0, 0] = 100 + step
        return stamped


@dataclass(frozen=True)
class Negative:
    def __call__(self, image: Image, camera: str, step: int) -> Image:
        return 255 - image


def images(world: MujocoWorld, size: int = 64) -> dict[str, Image]:
    return {key: value for key, value in world.observe(size=size).items() if key.endswith("_image")}


def test_images_have_the_asked_size_and_opengl_rows() -> None:
    world = TinyWorld()
    for size in (16, 300, 64):
        seen = images(world, size)
        assert list(seen) == ["agentview_image", "robot0_eye_in_hand_image"]
        assert all(image.shape == (size, size, 3) and image.dtype == np.uint8 for image in seen.values())
    # The table is below the horizon; in OpenGL order the bottom row comes first.
    agentview = seen["agentview_image"].astype(int)
    assert agentview[8, 32].sum() > agentview[-1, 32].sum() + 100


def test_a_wide_image_shows_what_the_square_one_shows_and_more_on_both_sides() -> None:
    world = TinyWorld()
    square = images(world, 48)
    wide = world.observe(size=(48, 64))
    for key, image in square.items():
        assert wide[key].shape == (48, 64, 3)
        middle = wide[key][:, 8:56].astype(int)
        assert np.abs(middle - image).mean() < 0.5
        assert np.abs(wide[key][:, :48].astype(int) - image).mean() > 4
    assert world.observe(size=(64, 48))["agentview_image"].shape == (64, 48, 3)
    with pytest.raises(SubstrateError, match=r"size=\(64, 0\)"):
        world.observe(size=(64, 0))


def test_an_image_does_not_depend_on_what_was_drawn_before() -> None:
    world = TinyWorld()
    small = images(world)
    images(world, 500)
    assert all(np.array_equal(small[key], value) for key, value in images(world).items())


def test_worlds_of_one_process_are_drawn_apart() -> None:
    worlds: list[MujocoWorld] = [TinyWorld(), EmbeddedWorld(build_scene("libero_object", 0)), TinyWorld()]
    worlds[2].place("box_1", (0.3, 0.3, 0.6))
    alone = [images(world) for world in worlds]
    for _ in range(2):
        for world, expected in zip(worlds, alone, strict=True):
            assert all(np.array_equal(expected[key], value) for key, value in images(world).items())
    assert not np.array_equal(alone[0]["agentview_image"], alone[1]["agentview_image"])
    worlds[1].close()
    assert all(np.array_equal(alone[0][key], value) for key, value in images(worlds[0]).items())


CHEQUERED = """<mujoco><asset>
  <texture name="chequered" type="2d" builtin="checker" width="64" height="64" rgb1="{red} 0 0" rgb2="0 0 1"/>
  <texture name="plain" type="2d" builtin="flat" width="64" height="64" rgb1="0 1 0"/>
  <material name="first" texture="chequered"/><material name="second" texture="plain"/>
  <mesh name="corner" vertex="0 0 0 1 0 0 0 1 0 0 0 {high}"/>
</asset><worldbody>
  <light pos="0 0 3"/><camera name="eye" pos="0 0 3"/>
  <geom name="floor" type="plane" size="{floor} 1 0.1" material="first" group="1"/>
  <geom type="mesh" mesh="corner" pos="{place} 0 0.1" group="1"/>
</worldbody></mujoco>"""


TWO_COLOURS = """<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
<worldbody>
  <camera name="eye" pos="0 0 2"/>
  <geom type="plane" size="5 5 0.1" rgba="1 0 0 1" group="1"/>
  <geom type="box" size="0.3 0.3 0.1" euler="0 0 20" rgba="0 0 1 1" group="1"/>
</worldbody></mujoco>"""


def drawer(**values: float) -> tuple[Renderer, mujoco.MjModel]:
    """A small scene: how red and how wide its floor is, how high its one object, and where that stands."""
    model = mujoco.MjModel.from_xml_string(
        CHEQUERED.format(**{"red": 1, "high": 1, "floor": 1, "place": 0, **values})
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Renderer(model, data), model


def uploads() -> int:
    return len(renderer._in_use)


def alone(**values: float) -> Image:
    """What a scene looks like that shares nothing."""
    known = list(renderer._in_use)
    renderer._in_use.clear()
    drawn, _ = drawer(**values)
    image = drawn.render("eye", 64)
    drawn.close()
    renderer._in_use.update(known)
    return image


def test_without_samples_a_pixel_is_of_one_surface_and_the_buffers_are_others() -> None:
    before = uploads()
    model = mujoco.MjModel.from_xml_string(TWO_COLOURS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sampled, plain = Renderer(model, data), Renderer(model, data, samples=0)
    colours = [len(np.unique(each.render("eye", 64).reshape(-1, 3), axis=0)) for each in (sampled, plain)]
    assert uploads() == before + 2
    assert colours[0] > colours[1] == 2
    sampled.close()
    plain.close()
    assert uploads() == before


def test_scenes_with_the_same_textures_and_meshes_share_them() -> None:
    before = uploads()
    one, model = drawer()
    other, _ = drawer(place=0.5)
    assert np.array_equal(one.render("eye", 64), alone())
    assert np.array_equal(other.render("eye", 64), alone(place=0.5))
    assert uploads() == before + 1
    shown = one.render("eye", 64)
    model.mat_texid[:] = model.mat_texid[::-1].copy()
    assert not np.array_equal(one.render("eye", 64), shown)
    assert np.array_equal(other.render("eye", 64), alone(place=0.5)), "another scene's materials show"
    one.close()
    assert np.array_equal(other.render("eye", 64), alone(place=0.5))
    assert other.render("eye", 300).shape == (300, 300, 3)
    assert uploads() == before + 1
    other.close()
    assert uploads() == before


@pytest.mark.parametrize("shareable", [True, False])
def test_what_rests_goes_where_another_scene_shares_nothing(shareable: bool) -> None:
    before = uploads()
    one, _ = drawer()
    other, _ = drawer(red=0.5)
    shown = one.render("eye", 64)
    one.rest(shareable=shareable)
    assert uploads() == before + shareable
    other.render("eye", 64)
    assert uploads() == before + 1
    assert np.array_equal(one.render("eye", 64), shown)
    assert uploads() == before + 2
    one.rest(shareable=True)
    same, _ = drawer(place=0.5)
    assert np.array_equal(same.render("eye", 64), alone(place=0.5))
    assert uploads() == before + 2
    for drawn in (one, other, same):
        drawn.close()
    assert uploads() == before


def test_a_scene_that_nobody_closes_leaves_nothing_behind() -> None:
    gc.collect()
    before = uploads()
    drawn, _ = drawer(red=0.25)
    drawn.render("eye", 64)
    assert uploads() == before + 1
    del drawn
    gc.collect()
    assert uploads() == before


@pytest.mark.parametrize("difference", [{"red": 0.5}, {"high": 2}, {"floor": 2}])
def test_scenes_with_other_textures_meshes_or_planes_share_nothing(difference: dict[str, float]) -> None:
    before = uploads()
    one, _ = drawer()
    other, _ = drawer(**difference)
    shown = one.render("eye", 64)
    assert np.array_equal(other.render("eye", 64), alone(**difference))
    assert not np.array_equal(shown, other.render("eye", 64))
    assert uploads() == before + 2
    one.close()
    other.close()


@pytest.mark.parametrize("place", [0, renderer._PIECE - 1, renderer._PIECE, -1])
def test_a_byte_that_differs_is_found_in_every_piece(place: int) -> None:
    one = np.zeros(2 * renderer._PIECE + 3, np.uint8)
    other = one.copy()
    assert renderer._equal(one, other)
    assert not renderer._equal(one, other[:-1])
    other[place] = 1
    assert not renderer._equal(one, other)


def test_looking_changes_nothing() -> None:
    world, blind = TinyWorld(), TinyWorld()
    for _ in range(3):
        images(world)
        for each in (world, blind):
            each.step((0.3, 0.2, -0.1, 0.0, 0.0, 0.0, 1.0))
        assert world.digest() == blind.digest()


def test_the_embedded_world_looks_without_a_trace() -> None:
    world = EmbeddedWorld(build_scene("libero_spatial", 0))
    before = world.digest()
    images(world)
    assert world.digest() == before


def test_a_parked_object_is_not_seen() -> None:
    world = TinyWorld()
    seen = images(world)["agentview_image"].astype(int)

    def reddish(image: np.ndarray) -> int:
        return int((image[..., RED] > 2 * image[..., 1:].max(axis=-1)).sum())

    assert reddish(seen) > 10
    world.park("box_1", world.position("box_1"))
    assert reddish(images(world)["agentview_image"].astype(int)) == 0
    world.unpark("box_1", world.parked_pose("box_1")[0])
    assert np.array_equal(images(world)["agentview_image"], seen)


@pytest.mark.parametrize(
    ("field", "index", "value"),
    [
        ("cam_fovy", 0, 60.0),
        ("light_diffuse", slice(None), 0.1),
        ("geom_rgba", slice(None), 0.5),
        ("mat_rgba", slice(None), 0.5),
        ("mat_texid", slice(None), -1),
    ],
)
def test_an_alteration_is_seen_and_a_reset_takes_it_back(
    field: str, index: int | slice, value: float
) -> None:
    world = TinyWorld()
    world.reset(0)
    before = images(world)["agentview_image"]
    world.alter(field, index, value)
    assert not np.array_equal(images(world)["agentview_image"], before)
    world.reset(0)
    assert np.array_equal(images(world)["agentview_image"], before)


def test_filters_follow_one_another_and_count_from_their_start() -> None:
    world = TinyWorld()
    world.step(NOOP_ACTION)
    plain = images(world)
    world.add_filter(Stamp())
    assert all(image[0, 0].tolist() == [100] * 3 for image in images(world).values())
    world.step(NOOP_ACTION)
    world.step(NOOP_ACTION)
    world.add_filter(Negative())
    world.add_filter(Stamp())
    world.add_filter(Negative())
    for image in images(world).values():
        # The second stamp is new, and only the last filter follows it.
        assert image[0, 0].tolist() == [155] * 3
        assert image.flags.writeable
    world.reset(0)
    world.step(NOOP_ACTION)
    assert all(np.array_equal(plain[key], image) for key, image in images(world).items())
    world.add_filter(Stamp())
    world.step(NOOP_ACTION)
    world.add_filter(Negative())
    assert all(image[0, 0].tolist() == [255 - 101] * 3 for image in images(world).values())


def test_a_filter_that_breaks_the_image_is_refused() -> None:
    @dataclass(frozen=True)
    class Crop:
        def __call__(self, image: Image, camera: str, step: int) -> Image:
            return image[1:]

    world = TinyWorld()
    world.add_filter(Crop())
    with pytest.raises(SubstrateError, match="shape and type"):
        world.observe(size=16)


def test_a_driver_that_draws_nothing_is_found_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    require_images()
    with monkeypatch.context() as patch:
        patch.setattr(Renderer, "render", lambda self, camera, size: np.zeros((size, size, 3), np.uint8))
        with pytest.raises(SimulatorError, match=r"one colour .*MUJOCO_GL"):
            require_images()

    def refuse(*args: object) -> None:
        raise mujoco.FatalError("OpenGL version 1.5 or higher required")

    monkeypatch.setattr(mujoco, "MjrContext", refuse)
    with pytest.raises(SimulatorError, match=r"1\.5 .*MUJOCO_GL"):
        require_images()


def test_a_camera_or_size_that_does_not_exist_is_refused() -> None:
    world = TinyWorld()
    with pytest.raises(SubstrateError, match=r"camera='agent'.*Did you mean 'agentview'"):
        world.observe(["agent"])
    with pytest.raises(SubstrateError, match=r"size=\(0, 0\)"):
        world.observe(size=0)
