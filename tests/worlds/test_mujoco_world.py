from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max.errors import ActionError, EntityError, SimulatorError, SubstrateError
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Image, World
from pytest_libero_max.worlds.mujoco_scenery import ALTERABLE
from pytest_libero_max.worlds.robot import NOOP_ACTION
from tests.worlds.states import differing, every_array, integration_state, random_actions

AWAY = (-2.0, 0.0, -5.0)


@dataclass(frozen=True)
class Darker:
    factor: float

    def __call__(self, image: Image, camera: str, step: int) -> Image:
        return (image * self.factor).astype(np.uint8)


@pytest.fixture
def world() -> TinyWorld:
    return TinyWorld()


def play(world: TinyWorld, seed: int, count: int) -> list[bytes]:
    digests = []
    for action in random_actions(seed, count):
        world.step(action)
        digests.append(world.digest())
    return digests


def disturb(world: TinyWorld) -> None:
    """Everything that an event may do to a world."""
    world.alter("cam_pos", 0, (1.0, 2.0, 3.0))
    world.alter("geom_rgba", slice(None), 0.25)
    world.alter("light_diffuse", slice(None), 0.1)
    world.place("cabinet_1", (-0.3, 0.1, 0.4), (0.0, 0.0, 0.0, 1.0))
    world.place("box_1", (0.2, 0.2, 0.6))
    world.park("clutter_1", AWAY)
    world.add_filter(Darker(0.5))
    world.set_control("absolute")


def test_tiny_world_is_a_world(world: TinyWorld) -> None:
    assert isinstance(world, World)


def test_every_alterable_field_is_an_array_of_the_model(world: TinyWorld) -> None:
    assert all(isinstance(getattr(world.model, field), np.ndarray) for field in ALTERABLE)
    assert list(ALTERABLE) == sorted(ALTERABLE)


def test_reset_leaves_no_trace_of_an_episode(world: TinyWorld) -> None:
    compiled = every_array(world.model)
    fresh = TinyWorld()
    fresh.reset(3)
    expected = [fresh.digest(), *play(fresh, 1, 40)]
    disturb(world)
    play(world, 2, 40)
    assert differing(compiled, every_array(world.model))
    world.reset(3)
    assert differing(compiled, every_array(world.model)) == []
    assert [world.digest(), *play(world, 1, 40)] == expected
    assert (world.filters, world.parked) == ((), ())


def test_initial_states_differ_and_repeat(world: TinyWorld) -> None:
    digests = []
    for init in (0, 1, 9, 0):
        world.reset(init)
        digests.append(world.digest())
    assert digests[0] == digests[3]
    assert len(set(digests)) == 3


def test_an_unknown_initial_state_is_refused(world: TinyWorld) -> None:
    with pytest.raises(SubstrateError, match="init=10"):
        world.reset(10)


@settings(max_examples=12, deadline=None)
@given(before=st.integers(0, 12), disturbed=st.booleans(), seed=st.integers(0, 5))
def test_a_restored_state_has_the_same_future(before: int, disturbed: bool, seed: int) -> None:
    world = TinyWorld()
    world.reset(seed)
    play(world, seed, before)
    if disturbed:
        disturb(world)
    state, digest = world.snapshot(), world.digest()
    expected = play(world, seed + 10, 15)
    disturb(world) if not disturbed else world.reset(0)
    world.restore(state)
    assert world.digest() == digest
    assert play(world, seed + 10, 15) == expected
    other = TinyWorld()
    other.restore(state)
    assert play(other, seed + 10, 15) == expected


def test_a_snapshot_does_not_follow_the_world(world: TinyWorld) -> None:
    state = world.snapshot()
    qpos, colour = state.physics.copy(), state.model["geom_rgba"].copy()
    play(world, 0, 3)
    world.alter("geom_rgba", slice(None), 0.5)
    assert np.array_equal(state.physics, qpos)
    assert np.array_equal(state.model["geom_rgba"], colour)
    with pytest.raises(ValueError, match="read-only"):
        state.physics[0] = 1.0


def test_a_state_of_another_scene_is_refused(world: TinyWorld) -> None:
    state = world.snapshot()
    object.__setattr__(state, "scene", "tiny/1")
    with pytest.raises(SubstrateError, match=r"tiny/1.*tiny/0"):
        world.restore(state)


def nudge(field: str) -> Callable[[TinyWorld], None]:
    def act(world: TinyWorld) -> None:
        value = getattr(world.model, field)
        world.alter(field, slice(None), value + 1 if value.dtype != bool else ~value)

    return act


@pytest.mark.parametrize("field", ALTERABLE)
def test_the_digest_sees_every_alterable_field(world: TinyWorld, field: str) -> None:
    before = world.digest()
    nudge(field)(world)
    assert world.digest() != before


@pytest.mark.parametrize(
    "act",
    [
        lambda world: world.step(NOOP_ACTION),
        lambda world: world.add_filter(Darker(0.5)),
        lambda world: world.park("box_1", AWAY),
        lambda world: world.place("box_1", np.add(world.position("box_1"), (0, 0, 1e-9))),
    ],
    ids=["step", "filter", "park", "place"],
)
def test_the_digest_sees_what_happened(world: TinyWorld, act: Callable[[TinyWorld], None]) -> None:
    before = world.digest()
    assert len(before) == 32
    act(world)
    assert world.digest() != before


def test_the_digest_tells_filters_apart(world: TinyWorld) -> None:
    state = world.snapshot()
    digests = set()
    for factor in (0.5, 0.5000001):
        world.restore(state)
        world.add_filter(Darker(factor))
        digests.add(world.digest())
    assert len(digests) == 2


def test_a_field_that_no_reset_restores_is_refused(world: TinyWorld) -> None:
    with pytest.raises(SubstrateError, match=r"geom_size.*Did you mean 'geom_\w+'"):
        world.alter("geom_size", 0, 1.0)


@pytest.mark.parametrize("field", ["cam_pos", "light_diffuse", "geom_rgba", "mat_rgba"])
def test_what_is_only_seen_leaves_the_physics_alone(world: TinyWorld, field: str) -> None:
    play(world, 0, 5)
    before = integration_state(world.model, world.data)
    nudge(field)(world)
    assert np.array_equal(before, integration_state(world.model, world.data))


def test_derived_data_follow_an_alteration(world: TinyWorld) -> None:
    camera = world.model.camera("agentview").id
    world.alter("cam_pos", camera, (0.5, 0.25, 2.0))
    assert world.data.cam_xpos[camera].tolist() == [0.5, 0.25, 2.0]


@pytest.mark.parametrize("entity", ["box_1", "clutter_3"])
def test_placing_an_object_moves_nothing_else(world: TinyWorld, entity: str) -> None:
    play(world, 4, 10)
    before = world.snapshot()
    orientation = world.pose(entity)[1]
    world.place(entity, (0.3, 0.3, 0.7))
    assert world.position(entity).tolist() == [0.3, 0.3, 0.7]
    assert np.array_equal(world.pose(entity)[1], orientation)
    joint = world.model.joint(f"{entity}_joint0")
    assert not world.data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6].any()
    world.place(entity, before.physics[1 + joint.qposadr[0] : 4 + joint.qposadr[0]])
    moved = np.flatnonzero(world.snapshot().physics != before.physics)
    own = range(1 + world.model.nq + joint.dofadr[0], 7 + world.model.nq + joint.dofadr[0])
    warm = 1 + world.model.nq + world.model.nv + joint.dofadr[0]
    assert set(moved.tolist()) <= {*own, *range(warm, warm + 6)}


def test_placing_a_fixture_takes_its_parts_along(world: TinyWorld) -> None:
    drawer = world.model.body("cabinet_1_drawer").id
    before, at = world.data.xpos[drawer].copy(), world.position("cabinet_1")
    world.place("cabinet_1", np.add(at, (0.1, 0.0, 0.0)))
    assert world.data.xpos[drawer] - before == pytest.approx((0.1, 0.0, 0.0))


@pytest.mark.parametrize(
    ("position", "quaternion", "message"),
    [
        ((0.0, 0.0), None, "three finite numbers"),
        ((0.0, 0.0, np.nan), None, "three finite numbers"),
        ((0.0, 0.0, 1.0), (1.0, 1.0, 0.0, 0.0), "unit length"),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), "unit length"),
    ],
)
def test_a_pose_that_is_none_is_refused(
    world: TinyWorld, position: tuple[float, ...], quaternion: tuple[float, ...] | None, message: str
) -> None:
    before = world.digest()
    with pytest.raises(SubstrateError, match=message):
        world.place("box_1", position, quaternion)
    assert world.digest() == before


def test_a_parked_object_stays_where_it_is_and_touches_nothing(world: TinyWorld) -> None:
    play(world, 0, 20)
    for number, name in enumerate(("clutter_1", "clutter_2", "plate_1")):
        world.park(name, (-2.0 - 0.001 * number, 0.0, -5.0))  # inside one another and below the floor
    parked = {name: np.concatenate(world.pose(name)) for name in world.parked}
    for action in random_actions(1, 60):
        world.step(action)
        for name, pose in parked.items():
            assert np.array_equal(np.concatenate(world.pose(name)), pose)
            assert world.contacts(name) == ()
    for name in parked:
        joint = world.model.joint(f"{name}_joint0")
        assert not world.data.qvel[joint.dofadr[0] : joint.dofadr[0] + 6].any()


def test_a_parked_object_comes_back_exactly_as_it_was(world: TinyWorld) -> None:
    for _ in range(10):
        world.step(NOOP_ACTION)
    at, orientation = world.pose("clutter_2")
    compiled = every_array(world.model)
    world.park("clutter_2", AWAY)
    assert differing(compiled, every_array(world.model)) == ["geom_conaffinity", "geom_contype", "geom_group"]
    play(world, 0, 10)
    assert [part.tolist() for part in world.parked_pose("clutter_2")] == [at.tolist(), orientation.tolist()]
    world.unpark("clutter_2", at)
    assert differing(compiled, every_array(world.model)) == []
    assert np.array_equal(world.position("clutter_2"), at)
    assert np.array_equal(world.pose("clutter_2")[1], orientation)
    assert world.parked == ()
    assert not world.data.qfrc_applied.any()
    world.step(NOOP_ACTION)
    assert "main_table" in world.contacts("clutter_2")
    assert world.position("clutter_2") == pytest.approx(at, abs=1e-4)


def test_parking_does_not_disturb_the_rest_of_the_scene() -> None:
    """A parked object that nothing ever touched changes no other body's trajectory."""
    one, other = TinyWorld(), TinyWorld()
    other.park("clutter_5", AWAY)
    apart = other.model.joint("clutter_5_joint0").qposadr[0] + np.arange(7)
    for action in random_actions(6, 20) * (1, 1, 0, 0, 0, 0, 1):
        one.step(action)
        other.step(action)
        same = np.delete(one.data.qpos, apart), np.delete(other.data.qpos, apart)
        assert same[1] == pytest.approx(same[0], abs=1e-9)


def test_a_push_gives_an_object_a_velocity_and_leaves_it_where_it_is(world: TinyWorld) -> None:
    world.reset(0)
    play(world, 0, 5)
    calm = world.snapshot()
    at = world.position("box_1")
    turning = world.data.qvel.copy()
    world.push("box_1", (1.0, 0.0, 0.0))
    assert (world.position("box_1") == at).all()
    assert sorted(np.flatnonzero(world.data.qvel != turning)) == [world.model.body("box_1_main").dofadr[0]]
    pushed = world.digest()
    world.step(NOOP_ACTION)
    assert world.position("box_1")[0] > at[0] + 0.002
    world.restore(calm)
    assert world.digest() != pushed
    world.push("box_1", (1.0, 0.0, 0.0))
    assert world.digest() == pushed


@pytest.mark.parametrize(
    ("entity", "velocity", "message"),
    [
        ("cabinet_1", (1, 0, 0), "is a fixture: only objects have a free joint"),
        ("clutter_1", (1, 0, 0), "is parked, so it cannot be pushed"),
        ("box_1", (1, 0), "three finite numbers in m/s"),
        ("box_1", (np.nan, 0, 0), "three finite numbers in m/s"),
        ("bxo_1", (1, 0, 0), "Did you mean 'box_1'"),
    ],
)
def test_a_push_needs_an_object_and_a_velocity(
    world: TinyWorld, entity: str, velocity: tuple[float, ...], message: str
) -> None:
    world.reset(0)
    world.park("clutter_1", (-2.0, 0.0, -5.0))
    with pytest.raises((SubstrateError, EntityError), match=message):
        world.push(entity, velocity)


def test_parking_needs_an_object_that_is_there(world: TinyWorld) -> None:
    with pytest.raises(SubstrateError, match=r"'cabinet_1' is a fixture"):
        world.park("cabinet_1", AWAY)
    world.park("box_1", AWAY)
    with pytest.raises(SubstrateError, match="already parked"):
        world.park("box_1", AWAY)
    with pytest.raises(SubstrateError, match="unpark it there"):
        world.place("box_1", (0.0, 0.0, 1.0))
    with pytest.raises(SubstrateError, match="'plate_1' is not parked"):
        world.unpark("plate_1", (0.0, 0.0, 1.0))


def test_contacts_are_named_by_entity(world: TinyWorld) -> None:
    for _ in range(5):
        world.step(NOOP_ACTION)
    assert world.contacts("box_1") == ("main_table",)
    assert world.contacts("plate_1") == ("main_table",)
    assert world.contacts("main_table") == (
        "box_1",
        "clutter_1",
        "clutter_2",
        "clutter_3",
        "clutter_4",
        "clutter_5",
        "plate_1",
    )
    world.place("box_1", np.add(world.end_effector(), (0.0, 0.03, 0.0)))
    assert world.contacts("box_1") == ("gripper0",)


def test_success_is_the_box_on_the_plate(world: TinyWorld) -> None:
    assert not world.succeeded()
    world.place("box_1", np.add(world.position("plate_1"), (0.0, 0.0, 0.0399)))
    assert world.succeeded()


def test_an_unknown_entity_is_answered_with_the_closest_name(world: TinyWorld) -> None:
    with pytest.raises(EntityError, match=r"'clutter_9'.*Did you mean 'clutter_\d'"):
        world.position("clutter_9")


@pytest.mark.parametrize(
    ("action", "message"),
    [((0.0,) * 6, r"\(6,\)"), ([[0.0] * 7], r"\(1, 7\)"), ((0.0,) * 6 + (np.inf,), "not finite")],
)
def test_an_action_that_is_none_is_refused(world: TinyWorld, action: list[float], message: str) -> None:
    before = world.digest()
    with pytest.raises(ActionError, match=message):
        world.step(action)
    assert world.digest() == before


def test_a_simulation_that_blows_up_is_an_error_and_a_reset_cures_it(
    world: TinyWorld, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo leaves a log file where it is
    world.data.qvel[-1] = 1e30
    with pytest.raises(SimulatorError, match=r"tiny/0: .* control step 1"):
        world.step(NOOP_ACTION)
    world.reset(0)
    world.step(NOOP_ACTION)
    assert np.isfinite(world.data.qpos).all()


def test_a_joint_that_shoots_off_ends_the_episode(world: TinyWorld) -> None:
    world.data.qvel[-1] = 1e7
    with pytest.raises(SimulatorError, match=r"tiny/0: .* m/s"):
        world.step(NOOP_ACTION)


def test_a_filter_without_a_telling_repr_is_refused(world: TinyWorld) -> None:
    with pytest.raises(SubstrateError, match="frozen dataclass"):
        world.add_filter(lambda image, camera, step: image)


def test_actions_move_the_hand_and_the_fingers(world: TinyWorld) -> None:
    start = world.end_effector()
    for _ in range(4):
        world.step((1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0))
    opened = world.observe(cameras=())["robot0_gripper_qpos"]
    assert world.end_effector()[0] > start[0] + 0.05
    for _ in range(10):
        world.step((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    closed = world.observe(cameras=())["robot0_gripper_qpos"]
    assert abs(opened).sum() > 0.06 > 0.02 > abs(closed).sum()
    assert mujoco.__version__.startswith(("3.3.", "3.9."))


def test_under_absolute_control_the_hand_goes_where_it_is_told(world: TinyWorld) -> None:
    world.set_control("absolute")
    for _ in range(40):
        world.step((0.1, -0.2, 0.55, 9.0, 9.0, 9.0, 1.0))
    assert world.end_effector() == pytest.approx((0.1, -0.2, 0.55), abs=2e-3)
    assert np.ptp(world.observe(())["robot0_gripper_qpos"]) < 2e-3


def test_control_belongs_to_the_state_and_ends_with_the_episode(world: TinyWorld) -> None:
    delta, digest = world.snapshot(), world.digest()
    world.set_control("delta")
    assert world.digest() == digest
    world.set_control("absolute")
    absolute = world.snapshot()
    assert absolute.differing(delta) == ("control",)
    assert world.digest() != digest
    world.reset(0)
    assert world.snapshot().control == "delta"
    assert world.digest() == digest
    world.restore(absolute)
    assert world.snapshot().control == "absolute"
    world.restore(delta)
    assert world.digest() == digest
    with pytest.raises(SubstrateError, match=r"control='absolut'\. Did you mean 'absolute'"):
        world.set_control("absolut")  # type: ignore[arg-type]


def test_observations_do_not_follow_the_world(world: TinyWorld) -> None:
    seen = world.observe(cameras=())
    kept = {key: value.copy() for key, value in seen.items()}
    play(world, 0, 3)
    assert all(np.array_equal(seen[key], kept[key]) for key in kept)
    assert {key: value.shape for key, value in seen.items()} == {
        "robot0_eef_pos": (3,),
        "robot0_eef_quat": (4,),
        "robot0_gripper_qpos": (2,),
        "robot0_gripper_qvel": (2,),
        "robot0_joint_pos": (7,),
        "robot0_joint_vel": (7,),
    }
