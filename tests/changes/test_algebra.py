"""What holds for every change, drawn from the public strategies."""

import json

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Event
from pytest_libero_max.changes import Change, MoveObject, Nothing, ShiftCamera, change_from_dict
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.changes.world_comparison import (
    differing,
    full_state,
    play,
    pose_bytes,
    position_slices,
    same,
    set_up,
    velocity_slices,
)

WORLD = TinyWorld()
ENTITIES = WORLD.entities

MAY_WRITE = {
    "camera": {"model.cam_pos", "model.cam_quat", "model.cam_fovy"},
    "light": {"model.light_ambient", "model.light_diffuse", "model.light_specular"},
    "material": {"model.geom_rgba", "model.mat_rgba"},
    "pixels": {"filters"},
}
PARKING = {"model.geom_contype", "model.geom_conaffinity", "model.geom_group", "parked"}
POSE = {"qpos", "qvel", "physics", "model.body_pos"}
Actions = list[tuple[float, ...]]
WITHOUT_POSE = ("set_lighting", "shift_camera", "set_visual_theme", "set_sensor_corruption")


def events() -> st.SearchStrategy[Event]:
    return strategies.events(ENTITIES)


def actions() -> st.SearchStrategy[Actions]:
    return strategies.action_sequences(max_size=4)


@given(strategies.changes(ENTITIES), actions())
def test_only_the_declared_factors_change(change: Change, steps: Actions) -> None:
    WORLD.reset(0)
    play(WORLD, steps)
    before = full_state(WORLD)
    change.apply(WORLD)
    kinds = {factor.partition(":")[0] for factor in change.factors}
    allowed = set().union(*(MAY_WRITE.get(kind, set()) for kind in kinds))
    if "pose" in kinds:
        allowed |= POSE
        if change.operation == "remove_object":
            allowed |= PARKING
    assert differing(before, full_state(WORLD)) <= allowed


@given(strategies.changes(ENTITIES, operations=WITHOUT_POSE), actions())
def test_changes_of_what_is_seen_leave_the_physical_future_as_it_was(change: Change, steps: Actions) -> None:
    WORLD.reset(0)
    play(WORLD, steps)
    undisturbed = WORLD.snapshot()
    play(WORLD, steps)
    expected = WORLD.snapshot().physics
    WORLD.restore(undisturbed)
    change.apply(WORLD)
    assert same(WORLD.snapshot().physics, undisturbed.physics)
    play(WORLD, steps)
    assert same(WORLD.snapshot().physics, expected)


@given(strategies.changes(ENTITIES, operations=["shift_camera"]))
def test_a_camera_shift_touches_no_other_camera(change: Change) -> None:
    assert isinstance(change, ShiftCamera)
    WORLD.reset(0)
    shifted = WORLD.model.camera(change.camera).id
    others = [camera for camera in range(WORLD.model.ncam) if camera != shifted]
    before = [getattr(WORLD.model, field)[others].copy() for field in ("cam_pos", "cam_quat", "cam_fovy")]
    change.apply(WORLD)
    after = [getattr(WORLD.model, field)[others] for field in ("cam_pos", "cam_quat", "cam_fovy")]
    assert all(same(one, other) for one, other in zip(before, after, strict=True))


@given(events(), actions())
def test_an_event_moves_only_what_it_names(event: Event, steps: Actions) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, steps)
    qpos, qvel = WORLD.data.qpos.copy(), WORLD.data.qvel.copy()
    poses = {name: pose_bytes(WORLD, name) for name in ENTITIES}
    change.apply(WORLD)
    moved = {factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:")}
    for name in ENTITIES:
        if name not in moved:
            assert pose_bytes(WORLD, name) == poses[name]
    for name in moved:
        for array, slices in ((qpos, position_slices(WORLD)), (qvel, velocity_slices(WORLD))):
            if name in slices:
                array[slices[name]] = 0.0
                (WORLD.data.qpos if array is qpos else WORLD.data.qvel)[slices[name]] = 0.0
    assert same(qpos, WORLD.data.qpos)
    assert same(qvel, WORLD.data.qvel)


@given(events(), actions())
def test_evidence_is_what_was_measured_and_plain_json(event: Event, steps: Actions) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, steps)
    evidence = change.apply(WORLD)
    record = evidence.to_dict()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["operation"] == change.operation
    assert record["factors"] == sorted(change.factors)
    assert record["before"].keys() == record["after"].keys()
    for name, position in record["after"].get("position_m", {}).items():
        assert position == WORLD.position(name).tolist()


@given(events(), actions())
def test_an_event_persists(event: Event, steps: Actions) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    change.apply(WORLD)
    before = full_state(WORLD)
    play(WORLD, steps)
    assert not {name for name in differing(before, full_state(WORLD)) if name.startswith("model.")}
    assert full_state(WORLD)["filters"] == before["filters"]
    assert WORLD.parked == ()


@given(strategies.events(ENTITIES, names=("distractor_burst", "obstacle_insertion")))
def test_an_insertion_happens_once(event: Event) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    change.apply(WORLD)
    after = WORLD.digest()
    with pytest.raises(ChangeError, match="already"):
        change.apply(WORLD)
    assert WORLD.digest() == after


@given(events(), actions(), actions())
def test_the_same_event_from_the_same_state_gives_the_same_world(
    event: Event, prefix: Actions, rest: Actions
) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, prefix)
    branch = WORLD.snapshot()
    digests = []
    for _ in range(2):
        WORLD.restore(branch)
        change.apply(WORLD)
        play(WORLD, rest)
        digests.append(WORLD.digest())
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, prefix)
    change.apply(WORLD)
    play(WORLD, rest)
    digests.append(WORLD.digest())
    assert len(set(digests)) == 1


@given(events(), actions())
def test_no_trace_of_an_event_survives_a_reset(event: Event, steps: Actions) -> None:
    WORLD.reset(1)
    fresh = full_state(WORLD)
    change = set_up(WORLD, event)
    play(WORLD, steps)
    change.apply(WORLD)
    play(WORLD, steps)
    WORLD.reset(1)
    assert differing(fresh, full_state(WORLD)) == set()


@given(events(), actions())
def test_strength_zero_alters_nothing(event: Event, steps: Actions) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, steps)
    before, digest = full_state(WORLD), WORLD.digest()
    change.scaled(0.0).apply(WORLD)
    assert WORLD.digest() == digest
    assert differing(before, full_state(WORLD)) == set()


@given(events())
def test_strength_one_is_the_change_itself(event: Event) -> None:
    change = change_from_dict(event.change)
    assert change.scaled(1.0) == change
    assert change.scaled(1) == change


@given(strategies.changes(ENTITIES), strategies.strengths())
def test_a_scaled_change_is_a_change_that_a_manifest_can_hold(change: Change, strength: float) -> None:
    assume(change.operation != "remove_object" or strength in (0.0, 1.0))
    scaled = change.scaled(strength)
    assert change_from_dict(scaled.to_dict()) == scaled
    assert change_from_dict(json.loads(json.dumps(scaled.to_dict()))) == scaled
    assert isinstance(scaled, Nothing) or scaled.factors == change.factors
    hash(scaled)


@given(strategies.changes(ENTITIES, operations=["move_object"]), strategies.strengths())
def test_a_scaled_move_goes_that_share_of_the_way(change: Change, strength: float) -> None:
    assert isinstance(change, MoveObject)
    WORLD.reset(0)
    before = WORLD.position(change.object)
    change.scaled(strength).apply(WORLD)
    expected = before + strength * np.array(change.delta_position_m)
    assert np.allclose(WORLD.position(change.object), expected, rtol=0, atol=1e-15)


@given(st.data(), actions())
@settings(max_examples=25)
def test_what_was_taken_out_stays_put_and_comes_back_as_it_was(data: st.DataObject, steps: Actions) -> None:
    event = data.draw(strategies.events(ENTITIES, names=["distractor_burst", "obstacle_insertion"]))
    WORLD.reset(0)
    play(WORLD, steps)
    taken = [raw["object"] for raw in event.setup]
    poses = {name: WORLD.pose(name) for name in taken}
    change = set_up(WORLD, event)
    parked = {name: pose_bytes(WORLD, name) for name in taken}
    play(WORLD, steps * 5)
    for name in taken:
        assert pose_bytes(WORLD, name) == parked[name]
        assert WORLD.contacts(name) == ()
        assert np.array_equal(WORLD.parked_pose(name)[0], poses[name][0])
    change.apply(WORLD)
    for name in taken:
        assert np.array_equal(WORLD.pose(name)[1], poses[name][1])
        assert not WORLD.data.qvel[velocity_slices(WORLD)[name]].any()


def _disjoint(changes: tuple[Change, Change]) -> bool:
    return not changes[0].factors & changes[1].factors


@given(st.tuples(strategies.changes(ENTITIES), strategies.changes(ENTITIES)).filter(_disjoint), actions())
def test_changes_of_different_factors_commute(changes: tuple[Change, Change], steps: Actions) -> None:
    """Worlds remember in which order filters were added and objects taken out; all else is the same."""
    states = []
    for order in (changes, changes[::-1]):
        WORLD.reset(0)
        play(WORLD, steps)
        for change in order:
            change.apply(WORLD)
        play(WORLD, steps)
        state = full_state(WORLD)
        states.append(state | {name: sorted(map(repr, state[name])) for name in ("filters", "parked")})
    assert not differing(*states)
