"""The changes that only source variations use, in an embedded scene."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.changes import (
    BumpObject,
    Change,
    CorruptPicture,
    CoverEntity,
    OffsetArm,
    OpenGripper,
    OrbitCamera,
    PlaceCamera,
    PutObject,
    SetGlare,
    SetInstruction,
    SetLamps,
    SetTask,
    SetTexture,
    TurnObject,
)
from pytest_libero_max.errors import ChangeError, EntityError, SubstrateError
from pytest_libero_max.substrates.embedded.remodel import Remodel, remodelled
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Array
from pytest_libero_max.worlds.robot import NOOP_ACTION
from tests.changes.world_comparison import differing, full_state, play, pose_bytes

PIVOT = (0.0, 0.0, 0.8)
BOWL, PLATE = "akita_black_bowl_1", "plate_1"
ARM = (0.1, -0.1, 0.05, 0.1, 0.0, -0.1, 0.2)
PHYSICS = {"qpos", "qvel", "physics", "controller"}

CHANGES: dict[str, tuple[Change, set[str]]] = {
    "orbit": (
        OrbitCamera("agentview", PIVOT, 10.0, 30.0, 1.2, 5.0, -4.0),
        {"model.cam_pos", "model.cam_quat"},
    ),
    "place": (
        PlaceCamera.looking_at("agentview", (0.5, 0.3, 1.5), (0.0, 0.0, 0.9)),
        {"model.cam_pos", "model.cam_quat"},
    ),
    "lamps": (
        SetLamps(diffuse_factor=(1.4, 0.8, 0.6), specular=3.0, azimuth_degrees=40.0, tilt_degrees=10.0),
        {"model.light_diffuse", "model.light_ambient", "model.light_specular", "model.light_dir"},
    ),
    "levels": (
        SetLamps(levels=(0.02, 0.16, 0.01)),
        {"model.light_diffuse", "model.light_ambient", "model.light_specular"},
    ),
    "texture": (SetTexture("room_table", "surface_cork"), {"model.mat_texid"}),
    "cover": (
        CoverEntity(PLATE, (0.9, 0.5, 0.5), "surface_cork"),
        {"model.mat_texid", "model.mat_rgba", "model.geom_rgba"},
    ),
    "picture": (CorruptPicture("agentview", "fog", 4, 11), {"filters"}),
    "glare": (SetGlare(0.8, 0.5, 0.5, 0.3), {"filters"}),
    "arm": (OffsetArm(ARM, keep_clear=True), PHYSICS),
    "open": (OpenGripper(), {"physics", "controller"}),
    "bump": (BumpObject(BOWL, (0.5, 0.0, 0.2)), {"physics", "qvel"}),
    "put": (PutObject(BOWL, "main_table", (0.1, -0.02), "cookies_1"), PHYSICS),
    "turn": (TurnObject(BOWL, 45.0), PHYSICS),
    "words": (SetInstruction("grab the bowl"), set()),
    "task": (
        SetTask("put the ramekin on the plate", (("on", "glazed_rim_porcelain_ramekin_1", PLATE),)),
        set(),
    ),
}
each = pytest.mark.parametrize("name", CHANGES)


@pytest.fixture(scope="module")
def world() -> Iterator[EmbeddedWorld]:
    plan = Remodel(surfaces=("cork",))
    base = EmbeddedWorld(build_scene("libero_spatial", 0))
    world = EmbeddedWorld(remodelled(build_scene("libero_spatial", 0), plan), plan, base.start)
    yield world
    world.close()
    base.close()


@each
def test_it_writes_nothing_but_its_factors_and_a_reset_undoes_it(world: EmbeddedWorld, name: str) -> None:
    change, may_write = CHANGES[name]
    world.reset(1)
    fresh, words = full_state(world), world.language
    poses = {entity: pose_bytes(world, entity) for entity in world.entities}
    change.apply(world)
    assert differing(fresh, full_state(world)) <= may_write
    assert differing(fresh, full_state(world)) or world.assigned != (None, None)
    moved = {entity for entity in poses if pose_bytes(world, entity) != poses[entity]}
    declared = {f.removeprefix("pose:") for f in change.factors if f.startswith("pose:")}
    assert moved == (set() if name == "bump" else declared)  # what is bumped into moves in the steps after
    assert (world.language != words) == ("instruction" in change.factors)
    play(world, [NOOP_ACTION] * 2)
    world.reset(1)
    assert differing(fresh, full_state(world)) == set()
    assert world.language == words


@each
def test_at_strength_nought_it_changes_nothing_and_at_one_it_is_itself(
    world: EmbeddedWorld, name: str
) -> None:
    change, _ = CHANGES[name]
    world.reset(0)
    fresh = world.digest()
    change.scaled(0.0).apply(world)
    assert world.digest() == fresh
    assert change.scaled(1.0).to_dict() == change.to_dict()


@each
def test_a_snapshot_holds_it(world: EmbeddedWorld, name: str) -> None:
    change, _ = CHANGES[name]
    world.reset(0)
    change.apply(world)
    world.step(NOOP_ACTION)
    state, digest, words, goal = world.snapshot(), world.digest(), world.language, world.goal
    world.reset(0)
    world.restore(state)
    assert (world.digest(), world.language, world.goal) == (digest, words, goal)


def test_an_orbit_keeps_the_distance_and_looks_at_the_same_point(world: EmbeddedWorld) -> None:
    world.reset(0)
    index = world.model.camera("agentview").id
    before, looked = world.model.cam_pos[index].copy(), axis(world, index)
    OrbitCamera("agentview", (0.0, 0.0, 0.8), azimuth_degrees=90.0).apply(world)
    after = world.model.cam_pos[index]
    assert after == pytest.approx([-before[1], before[0], before[2]])
    assert axis(world, index) == pytest.approx([-looked[1], looked[0], looked[2]])


def test_elevation_raises_and_a_longer_distance_is_longer(world: EmbeddedWorld) -> None:
    world.reset(0)
    index = world.model.camera("agentview").id
    before = world.model.cam_pos[index].copy()
    OrbitCamera("agentview", PIVOT, elevation_degrees=15.0).apply(world)
    raised = world.model.cam_pos[index].copy()
    assert raised[2] > before[2]
    assert np.linalg.norm(raised - PIVOT) == pytest.approx(np.linalg.norm(before - PIVOT))
    OrbitCamera("agentview", PIVOT, distance_scale=1.5).apply(world)
    away = np.linalg.norm(world.model.cam_pos[index] - PIVOT)
    assert away == pytest.approx(1.5 * np.linalg.norm(raised - PIVOT))


def test_a_placed_camera_has_its_aim_in_the_middle_and_stands_upright(world: EmbeddedWorld) -> None:
    world.reset(0)
    position, aim = np.array([0.5, 0.3, 1.5]), np.array([0.0, 0.1, 0.9])
    PlaceCamera.looking_at("agentview", tuple(position), tuple(aim)).apply(world)
    index = world.model.camera("agentview").id
    ahead = (aim - position) / np.linalg.norm(aim - position)
    assert axis(world, index) == pytest.approx(-ahead, abs=1e-6)
    right = world.data.cam_xmat[index].reshape(3, 3)[:, 0]
    assert right[2] == pytest.approx(0.0, abs=1e-6)


def axis(world: EmbeddedWorld, index: int) -> Array:
    """What a camera turns its back on."""
    backwards: Array = world.data.cam_xmat[index].reshape(3, 3)[:, 2].copy()
    return backwards


def test_the_arm_starts_where_it_was_told_and_is_held_there(world: EmbeddedWorld) -> None:
    world.reset(0)
    joints = world.observe(cameras=())["robot0_joint_pos"].copy()
    hand = world.end_effector()
    OffsetArm(ARM).apply(world)
    assert world.observe(cameras=())["robot0_joint_pos"] == pytest.approx(joints + ARM)
    moved = world.end_effector()
    assert np.linalg.norm(moved - hand) > 0.03
    play(world, [NOOP_ACTION] * 10)
    assert np.linalg.norm(world.end_effector() - moved) < 0.01


def test_an_arm_that_would_touch_something_goes_the_other_way(world: EmbeddedWorld) -> None:
    down = (0.0, 0.9, 0.0, 0.3, 0.0, 0.0, 0.0)  # into the table
    world.reset(0)
    joints = world.observe(cameras=())["robot0_joint_pos"].copy()
    OffsetArm(down, keep_clear=True).apply(world)
    turned = world.observe(cameras=())["robot0_joint_pos"] - joints
    assert turned == pytest.approx(np.negative(down))
    world.reset(0)
    OffsetArm(down).apply(world)
    assert any("gripper0" in world.contacts(name) for name in world.entities)


def test_a_joint_beyond_its_limit_is_refused(world: EmbeddedWorld) -> None:
    world.reset(0)
    with pytest.raises(SubstrateError, match="within the joints' limits"):
        OffsetArm((0.0, 0.0, 0.0, 2.9, 0.0, 0.0, 0.0)).apply(world)


def test_a_bump_adds_a_velocity_to_an_object_and_is_not_taken_back(world: EmbeddedWorld) -> None:
    world.reset(0)
    bump = BumpObject(BOWL, (0.5, 0.0, 0.2))
    evidence = bump.apply(world)
    gained = np.subtract(evidence.after["velocity_m_s"], evidence.before["velocity_m_s"])
    assert gained.tolist() == pytest.approx([0.5, 0.0, 0.2])
    at = world.position(BOWL)
    world.step(NOOP_ACTION)
    assert world.position(BOWL)[0] > at[0] + 0.005
    with pytest.raises(ChangeError, match="taken back"):
        bump.reverted(evidence)
    with pytest.raises(ChangeError, match=r"bump_object\.object='main_table' is a surface.*akita"):
        BumpObject("main_table", (0.5, 0.0, 0.2)).apply(world)


def test_an_opened_gripper_closes_again_within_eight_steps(world: EmbeddedWorld) -> None:
    closing = (*NOOP_ACTION[:-1], 1.0)

    def width() -> float:
        return float(np.ptp(world.observe(cameras=())["robot0_gripper_qpos"]))

    world.reset(0)
    play(world, [closing] * 20)
    closed = width()
    OpenGripper().apply(world)
    assert width() == closed
    play(world, [closing] * 3)
    assert width() > closed + 0.01
    play(world, [closing] * 17)
    assert width() == pytest.approx(closed, abs=1e-3)


def test_what_was_dropped_is_not_taken_back(world: EmbeddedWorld) -> None:
    world.reset(0)
    change = OpenGripper()
    with pytest.raises(ChangeError, match=r"taken back: .* fallen"):
        change.reverted(change.apply(world))


def test_the_tiny_world_has_no_arm_to_pose_and_one_goal_only() -> None:
    world = TinyWorld()
    with pytest.raises(SubstrateError, match="no arm"):
        OffsetArm(ARM).apply(world)
    with pytest.raises(SubstrateError, match="no gripper"):
        OpenGripper().apply(world)
    with pytest.raises(SubstrateError, match="own goal"):
        SetTask("x", (("on", "box_1", "plate_1"),)).apply(world)
    SetInstruction("go").apply(world)
    assert world.language == "go"


def test_what_is_put_rests_where_it_was_put(world: EmbeddedWorld) -> None:
    world.reset(0)
    PutObject(BOWL, "cookies_1", (0.0, 0.0), "cookies_1", 30.0).apply(world)
    start = world.position(BOWL)
    assert start[:2] == pytest.approx(world.position("cookies_1")[:2])
    play(world, [NOOP_ACTION] * 20)
    assert np.linalg.norm(world.position(BOWL) - start) < 0.004
    assert "cookies_1" in world.contacts(BOWL)


def test_a_put_beside_its_carrier_is_refused(world: EmbeddedWorld) -> None:
    world.reset(0)
    with pytest.raises(ChangeError, match=f"{BOWL!r} does not meet 'cookies_1'"):
        PutObject(BOWL, "cookies_1", (0.3, 0.0), "cookies_1").apply(world)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (PutObject("plate_2", "main_table", (0.0, 0.0)), EntityError, "plate_2"),
        (PutObject("flat_stove_1", "main_table", (0.0, 0.0)), ChangeError, "is a fixture"),
        (PutObject(BOWL, "main_tabel", (0.0, 0.0)), EntityError, "Did you mean 'main_table'"),
        (TurnObject("main_table", 5.0), ChangeError, "surface that others stand on"),
        (SetTexture("room_tabel", "surface_cork"), ChangeError, "Did you mean 'room_table'"),
        (SetTexture("room_table", "surface_crok"), ChangeError, "Did you mean 'surface_cork'"),
        (CoverEntity("plate_2", (1.0, 1.0, 1.0)), EntityError, "Did you mean 'plate_1'"),
        (OrbitCamera("agentveiw", PIVOT), ChangeError, "orbit_camera.camera='agentveiw'"),
        (SetTask("x", (("onto", BOWL, PLATE),)), SubstrateError, "predicate='onto'"),
        (SetTask("x", (("on", "bowl", PLATE),)), SubstrateError, "'bowl' is not in this scene"),
    ],
    ids=lambda value: getattr(value, "operation", None),
)
def test_what_the_scene_lacks_is_named(
    world: EmbeddedWorld, change: Change, error: type[Exception], message: str
) -> None:
    world.reset(0)
    with pytest.raises(error, match=message):
        change.apply(world)


def test_a_new_task_is_done_when_its_own_goal_holds(world: EmbeddedWorld) -> None:
    world.reset(0)
    ramekin = "glazed_rim_porcelain_ramekin_1"
    SetTask("put the ramekin on the plate", (("on", ramekin, PLATE),)).apply(world)
    assert [(fact.predicate, fact.subject, fact.place) for fact in world.goal] == [("on", ramekin, PLATE)]
    PutObject(BOWL, PLATE, (0.0, 0.0), PLATE).apply(world)
    play(world, [NOOP_ACTION] * 5)
    assert not world.succeeded()
    world.reset(0)
    SetTask("put the ramekin on the plate", (("on", ramekin, PLATE),)).apply(world)
    PutObject(ramekin, PLATE, (0.0, 0.0), PLATE).apply(world)
    play(world, [NOOP_ACTION] * 5)
    assert world.succeeded()


def test_lamps_cannot_be_turned_below_the_horizon(world: EmbeddedWorld) -> None:
    world.reset(0)
    SetLamps(tilt_degrees=90.0).apply(world)
    assert (world.model.light_dir[:, 2] <= -math.cos(math.radians(80.0)) + 1e-6).all()


@pytest.mark.parametrize("name", ["orbit", "lamps", "texture", "cover", "picture", "glare"])
def test_it_is_seen(world: EmbeddedWorld, name: str) -> None:
    world.reset(0)
    before = world.observe(("agentview",), 64)["agentview_image"].astype(int)
    CHANGES[name][0].apply(world)
    after = world.observe(("agentview",), 64)["agentview_image"]
    assert np.abs(after - before).mean() > 0.1


def test_a_lamp_that_casts_shadows_darkens_parts_of_the_picture_until_reset(world: EmbeddedWorld) -> None:
    world.reset(0)
    before = world.observe(("agentview",), 128)["agentview_image"].astype(int)
    SetLamps(cast_shadows=True, tilt_degrees=10.0).apply(world)
    shaded = world.observe(("agentview",), 128)["agentview_image"].astype(int)
    assert ((before - shaded).max(axis=2) > 40).mean() > 0.01
    with pytest.raises(ChangeError, match="with shadows"):
        SetLamps(cast_shadows=True).scaled(0.5)
    world.reset(0)
    assert np.array_equal(world.observe(("agentview",), 128)["agentview_image"], before)
