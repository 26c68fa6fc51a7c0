"""What each operation does to a world, in numbers."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.changes import (
    Brightness,
    Change,
    InsertDistractors,
    InsertObstacle,
    MoveObject,
    Nothing,
    Placement,
    RemoveObject,
    SensorCorruption,
    SetLighting,
    SetSensorCorruption,
    SetVisualTheme,
    ShiftCamera,
)
from pytest_libero_max.errors import ChangeError, EntityError
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Array

OFFWORLD_M = (-2.0, 0.0, -5.0)


@pytest.fixture(scope="module")
def shared_world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


@pytest.fixture
def world(shared_world: TinyWorld) -> TinyWorld:
    shared_world.reset(0)
    return shared_world


@pytest.mark.parametrize(("scale", "brightness"), [(0.2, 0.75), (1.8, 1.25), (1.0, 1.25)])
def test_lighting_scales_every_lamp_and_the_pixels(world: TinyWorld, scale: float, brightness: float) -> None:
    fields = ("light_ambient", "light_diffuse", "light_specular")
    before = {field: getattr(world.model, field).copy() for field in fields}
    evidence = SetLighting(scale).apply(world)
    for field in fields:
        assert np.allclose(getattr(world.model, field), before[field] * scale)
        assert evidence.before[field] == before[field].tolist()
        assert evidence.after[field] == getattr(world.model, field).tolist()
    assert world.filters == ((Brightness(brightness), 0),)
    assert evidence.after["filters"] == [{"filter": "Brightness", "since_step": 0, "factor": brightness}]


def test_a_camera_is_moved_turned_and_refocused(world: TinyWorld) -> None:
    camera = world.model.camera("agentview").id
    position, quaternion = world.model.cam_pos[camera].copy(), world.model.cam_quat[camera].copy()
    axis = _forward(quaternion)
    evidence = ShiftCamera("agentview", (0.06, 0.0, 0.02), 18.0, 12.0).apply(world)
    assert np.allclose(world.model.cam_pos[camera] - position, [0.06, 0.0, 0.02], atol=1e-15)
    assert world.model.cam_fovy[camera] == 57.0
    turned = _forward(world.model.cam_quat[camera])
    c, s = math.cos(math.radians(18)), math.sin(math.radians(18))
    assert np.allclose(turned, [c * axis[0] - s * axis[1], s * axis[0] + c * axis[1], axis[2]])
    assert math.isclose(np.linalg.norm(world.model.cam_quat[camera]), 1.0, abs_tol=1e-15)
    assert evidence.before["camera_position_m"] == position.tolist()
    assert evidence.after["camera_fovy_deg"] == 57.0


def _forward(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    return -np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


@pytest.mark.parametrize("delta", [-41.0, 110.0])
def test_a_field_of_view_out_of_range_is_refused_before_anything_changes(
    world: TinyWorld, delta: float
) -> None:
    fresh = world.digest()
    with pytest.raises(ChangeError, match="within 5 to 150"):
        ShiftCamera("agentview", (0.1, 0.0, 0.0), 10.0, delta).apply(world)
    assert world.digest() == fresh


def test_an_unknown_camera_is_named_with_the_closest(world: TinyWorld) -> None:
    with pytest.raises(ChangeError, match=r"agentvew'.*'agentview'"):
        ShiftCamera("agentvew", (0.0, 0.0, 0.0), 1.0, 0.0).apply(world)


def test_a_theme_sends_every_colour_through_the_transform_and_keeps_opacity(world: TinyWorld) -> None:
    before = {field: getattr(world.model, field).copy() for field in ("geom_rgba", "mat_rgba")}
    SetVisualTheme((2, 0, 1), (0.70, 1.15, 1.30)).apply(world)
    for field, old in before.items():
        new = getattr(world.model, field)
        expected = np.clip(old[:, [2, 0, 1]] * [0.70, 1.15, 1.30], 0, 1)
        assert np.allclose(new[:, :3], expected, atol=1e-6)
        assert np.array_equal(new[:, 3], old[:, 3])


def test_half_a_theme_is_half_way(world: TinyWorld) -> None:
    old = world.model.geom_rgba.copy()
    SetVisualTheme((2, 0, 1), (0.70, 1.15, 1.30)).scaled(0.5).apply(world)
    full = np.clip(old[:, [2, 0, 1]] * [0.70, 1.15, 1.30], 0, 1)
    assert np.allclose(world.model.geom_rgba[:, :3], (old[:, :3] + full) / 2, atol=1e-6)


def test_corruption_starts_at_the_step_of_the_event(world: TinyWorld) -> None:
    for _ in range(3):
        world.step([0.0] * 7)
    SetSensorCorruption(24.0, 0.08, 7).apply(world)
    assert world.filters == ((SensorCorruption(24.0, 0.08, 7), 3),)


@pytest.mark.parametrize("entity", ["box_1", "cabinet_1"])
def test_a_move_keeps_orientation_and_stops(world: TinyWorld, entity: str) -> None:
    for _ in range(3):
        world.step([0.0] * 7)
    position, quaternion = world.pose(entity)
    target = position + np.array([0.06, -0.06, 0.0])
    evidence = MoveObject(entity, (0.06, -0.06, 0.0)).apply(world)
    assert np.array_equal(world.position(entity), target)
    assert np.array_equal(world.pose(entity)[1], quaternion)
    assert evidence.before["position_m"] == {entity: position.tolist()}
    assert evidence.after["position_m"] == {entity: target.tolist()}
    if entity == "box_1":
        first = world.model.body("box_1_main").dofadr[0]
        assert not world.data.qvel[first : first + 6].any()


def test_a_surface_cannot_be_moved(world: TinyWorld) -> None:
    with pytest.raises(ChangeError, match=r"'main_table' is the surface"):
        MoveObject("main_table", (0.1, 0.0, 0.0)).apply(world)


def test_a_fixture_cannot_be_taken_out(world: TinyWorld) -> None:
    with pytest.raises(ChangeError, match=r"'cabinet_1' is a fixture"):
        RemoveObject("cabinet_1", OFFWORLD_M).apply(world)


@pytest.mark.parametrize(
    "change",
    [
        MoveObject("box_2", (0.1, 0.0, 0.0)),
        RemoveObject("box_2", OFFWORLD_M),
        InsertObstacle("box_2", "plate_1", (0.1, 0.0, 0.0), True),
        InsertObstacle("plate_1", "box_2", (0.1, 0.0, 0.0), True),
    ],
)
def test_an_unknown_entity_is_named_with_the_closest(world: TinyWorld, change: Change) -> None:
    with pytest.raises(EntityError, match=r"'box_2'.*Did you mean 'box_1'"):
        change.apply(world)


def test_what_is_in_the_scene_cannot_come_back(world: TinyWorld) -> None:
    with pytest.raises(ChangeError, match=r"clutter_1' .*remove_object"):
        InsertObstacle("clutter_1", "box_1", (0.14, 0.0, 0.0), True).apply(world)


def test_what_was_taken_out_cannot_be_moved_removed_or_be_an_anchor(world: TinyWorld) -> None:
    RemoveObject("clutter_1", OFFWORLD_M).apply(world)
    RemoveObject("clutter_2", OFFWORLD_M).apply(world)
    for change in (
        MoveObject("clutter_1", (0.1, 0.0, 0.0)),
        RemoveObject("clutter_1", OFFWORLD_M),
        InsertObstacle("clutter_2", "clutter_1", (0.1, 0.0, 0.0), True),
    ):
        with pytest.raises(ChangeError, match=r"clutter_1' .*taken out"):
            change.apply(world)


def test_insertion_is_relative_to_where_the_anchor_is_now(world: TinyWorld) -> None:
    height = world.position("clutter_3")[2]
    orientation = world.pose("clutter_3")[1]
    RemoveObject("clutter_3", OFFWORLD_M).apply(world)
    MoveObject("box_1", (0.0, -0.1, 0.05)).apply(world)
    anchor = world.position("box_1")
    evidence = InsertObstacle("clutter_3", "box_1", (0.14, 0.01, 0.0), True).apply(world)
    assert np.array_equal(world.position("clutter_3"), [anchor[0] + 0.14, anchor[1] + 0.01, height])
    assert np.array_equal(world.pose("clutter_3")[1], orientation)
    assert evidence.before["taken_out"] == ["clutter_3"]
    assert evidence.after["taken_out"] == []


def test_insertion_may_take_its_height_from_the_anchor(world: TinyWorld) -> None:
    RemoveObject("clutter_3", OFFWORLD_M).apply(world)
    anchor = world.position("box_1")
    InsertObstacle("clutter_3", "box_1", (0.14, 0.0, 0.2), False).apply(world)
    assert np.array_equal(world.position("clutter_3"), anchor + np.array([0.14, 0.0, 0.2]))


def test_a_burst_brings_all_or_none(world: TinyWorld) -> None:
    RemoveObject("clutter_1", OFFWORLD_M).apply(world)
    missing = world.digest()
    burst = InsertDistractors(
        (
            Placement("clutter_1", "box_1", (0.12, 0.0, 0.0), True),
            Placement("clutter_2", "box_1", (-0.12, 0.0, 0.0), True),
        ),
        2,
    )
    with pytest.raises(ChangeError, match=r"clutter_2' .*already"):
        burst.apply(world)
    assert world.digest() == missing
    RemoveObject("clutter_2", OFFWORLD_M).apply(world)
    burst.apply(world)
    assert world.parked == ()


@pytest.mark.parametrize(
    "change",
    [
        RemoveObject("clutter_1", OFFWORLD_M),
        InsertObstacle("clutter_1", "box_1", (0.14, 0.0, 0.0), True),
        InsertDistractors((Placement("clutter_1", "box_1", (0.14, 0.0, 0.0), True),), 1),
    ],
)
def test_what_is_all_or_nothing_cannot_be_halved(change: Change) -> None:
    assert change.scaled(1) == change
    assert change.scaled(0) == Nothing()
    with pytest.raises(ChangeError, match="all or nothing"):
        change.scaled(0.5)


def test_the_scaled_camera_shift_is_linear() -> None:
    change = ShiftCamera("agentview", (0.06, 0.0, 0.02), 18.0, 12.0, "fixed_global_viewpoint")
    assert change.scaled(0.5) == ShiftCamera(
        "agentview", (0.03, 0.0, 0.01), 9.0, 6.0, "fixed_global_viewpoint"
    )


def test_the_scaled_light_is_linear_around_one() -> None:
    half = SetLighting(0.2).scaled(0.5)
    assert half == SetLighting(0.6, 0.875)
    assert SetLighting(1.8).scaled(0.25).pixel_brightness == 1.0625


def test_the_scaled_corruption_keeps_its_seed() -> None:
    assert SetSensorCorruption(24.0, 0.08, 7).scaled(0.25) == SetSensorCorruption(6.0, 0.02, 7)


def test_the_scaled_move_keeps_its_direction() -> None:
    move = MoveObject("box_1", (0.0, 0.12, 0.0), "main_table", 0.12, (0.0, 1.0), "candidate")
    assert move.scaled(0.5) == MoveObject(
        "box_1", (0.0, 0.06, 0.0), "main_table", 0.06, (0.0, 1.0), "candidate"
    )


@pytest.mark.parametrize("strength", [-0.1, 1.1, math.nan, "half", True])
def test_a_strength_out_of_range_is_refused(strength: Any) -> None:
    with pytest.raises(ChangeError, match="strength of set_lighting="):
        SetLighting(0.2).scaled(strength)


def test_events_are_seen(world: TinyWorld) -> None:
    for change in (
        SetLighting(0.2),
        ShiftCamera("agentview", (0.06, 0.0, 0.02), 18.0, 12.0),
        SetVisualTheme((2, 0, 1), (0.70, 1.15, 1.30)),
        SetSensorCorruption(24.0, 0.08, 3),
        MoveObject("box_1", (0.06, 0.0, 0.0)),
        RemoveObject("plate_1", OFFWORLD_M),
    ):
        world.reset(0)
        before = world.observe(["agentview"], 64)["agentview_image"].astype(int)
        change.apply(world)
        after = world.observe(["agentview"], 64)["agentview_image"].astype(int)
        assert np.abs(after - before).mean() > 0.1, change.operation


def test_a_shift_of_one_camera_leaves_the_picture_of_the_other(world: TinyWorld) -> None:
    before = world.observe(size=64)
    ShiftCamera("agentview", (0.06, 0.0, 0.02), 18.0, 12.0).apply(world)
    after = world.observe(size=64)
    assert not np.array_equal(before["agentview_image"], after["agentview_image"])
    assert np.array_equal(before["robot0_eye_in_hand_image"], after["robot0_eye_in_hand_image"])
