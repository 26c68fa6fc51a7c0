"""Every change taken back: its factors as they were, bit for bit."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.changes import (
    Change,
    CorruptPicture,
    Evidence,
    FreezeImages,
    HideInputs,
    MoveObject,
    Nothing,
    OrbitCamera,
    PlaceCamera,
    Reversal,
    SetGlare,
    SetInstruction,
    SetLamps,
    SetLighting,
    ShiftCamera,
    SwapImages,
    TurnObject,
)
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.changes.world_comparison import differing, full_state, play, pose_bytes

WORLD = TinyWorld()
ENTITIES = WORLD.entities
SEEN = [name for name, entity in ENTITIES.items() if entity.kind == "object"]
AT_REST = {"qvel", "physics"}
"""What a reversal of a moved object does not give back: it comes to rest."""


def angles() -> st.SearchStrategy[float]:
    return st.floats(-180.0, 180.0)


def more_changes() -> st.SearchStrategy[Change]:
    """Changes of the source variations that the public strategy leaves out."""
    vectors = st.tuples(*[st.floats(0.0, 1.5)] * 3)
    return st.one_of(
        st.builds(
            SetLamps,
            levels=st.none() | vectors,
            diffuse_factor=st.none() | vectors,
            specular=st.none() | st.floats(0.0, 2.0),
            azimuth_degrees=st.none() | angles(),
            tilt_degrees=st.none() | st.floats(-90.0, 90.0),
            cast_shadows=st.none() | st.booleans(),
        ),
        st.builds(
            OrbitCamera,
            st.just("agentview"),
            st.just((0.0, 0.0, 0.8)),
            angles(),
            angles(),
            st.floats(0.5, 2.0),
        ),
        st.builds(
            PlaceCamera,
            st.just("agentview"),
            st.tuples(*[st.floats(-2.0, 2.0)] * 3),
            st.just((0.0, 1.0, 0.0, 0.0)),
            st.floats(0.0, 1.0),
        ),
        st.builds(SetGlare, st.floats(0.0, 1.0), st.just(0.5), st.just(0.5), st.just(0.3)),
        st.builds(
            CorruptPicture, st.just("agentview"), st.just("fog"), st.integers(1, 10), st.integers(0, 9)
        ),
        st.builds(HideInputs, st.just(("agentview",)), st.booleans()),
        st.builds(FreezeImages, st.just(("agentview",)), st.just(16), st.just(16)),
        st.builds(
            SwapImages,
            st.just(("agentview",)),
            st.just(16),
            st.just(16),
            st.just("any"),
            st.just(0),
            st.just(1),
        ),
        st.builds(TurnObject, st.sampled_from(SEEN), angles()),
        st.builds(SetInstruction, st.text("abc", min_size=1)),
        st.just(Nothing()),
    )


@given(strategies.changes(ENTITIES) | more_changes(), strategies.action_sequences(max_size=4))
def test_a_reversal_gives_the_factors_back_bit_for_bit(
    change: Change, steps: list[tuple[float, ...]]
) -> None:
    WORLD.reset(0)
    play(WORLD, steps)
    before, assigned, digest = full_state(WORLD), WORLD.assigned, WORLD.digest()
    poses = {name: pose_bytes(WORLD, name) for name in ENTITIES}
    evidence = change.apply(WORLD)
    back = change.reverted(evidence)
    assert back.factors == change.factors
    record = back.apply(WORLD).to_dict()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert {name: pose_bytes(WORLD, name) for name in ENTITIES} == poses
    assert WORLD.assigned == assigned
    moves = any(factor.startswith("pose:") for factor in change.factors)
    assert differing(before, full_state(WORLD)) <= (AT_REST if moves else set())
    if not moves:
        assert WORLD.digest() == digest


@given(strategies.events(ENTITIES, names=["distractor_burst", "obstacle_insertion"]), st.data())
def test_an_insertion_is_taken_back_out_of_the_scene(event: object, data: st.DataObject) -> None:
    from tests.changes.world_comparison import set_up

    WORLD.reset(0)
    change = set_up(WORLD, event)  # type: ignore[arg-type]
    before, digest = full_state(WORLD), WORLD.digest()
    evidence = change.apply(WORLD)
    play(WORLD, data.draw(strategies.action_sequences(max_size=3)))
    WORLD.step([0.0] * 7)
    back = change.reverted(evidence)
    back.apply(WORLD)
    assert WORLD.parked == tuple(name for name, _ in before["parked"])
    assert full_state(WORLD)["parked"] == before["parked"]
    after = {name: value for name, value in full_state(WORLD).items() if name.startswith("model.")}
    assert not differing({name: before[name] for name in after}, after)
    with pytest.raises(ChangeError, match="already"):
        back.apply(WORLD)
    WORLD.reset(0)
    set_up(WORLD, event)  # type: ignore[arg-type]
    change.reverted(change.apply(WORLD)).apply(WORLD)
    assert WORLD.digest() == digest


def reversible() -> Iterator[Change]:
    yield SetLighting(0.4)
    yield ShiftCamera("agentview", (0.1, 0.0, 0.0), 10.0, 5.0)
    yield MoveObject(SEEN[0], (0.05, 0.0, 0.0))
    yield SetInstruction("other words")


@pytest.mark.parametrize("change", [*reversible()], ids=lambda change: change.operation)
def test_a_reversal_after_some_steps_leaves_the_rest_alone(change: Change) -> None:
    WORLD.reset(0)
    evidence = change.apply(WORLD)
    play(WORLD, [[0.3] * 7] * 5)
    before = {name: pose_bytes(WORLD, name) for name in ENTITIES}
    change.reverted(evidence).apply(WORLD)
    moved = {factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:")}
    assert {name for name in ENTITIES if pose_bytes(WORLD, name) != before[name]} <= moved


def test_only_what_was_altered_is_written_back() -> None:
    """A later change of the same camera survives where the earlier one altered something else."""
    WORLD.reset(0)
    shift = ShiftCamera("agentview", (0.1, 0.0, 0.0), 0.0, 0.0)
    evidence = shift.apply(WORLD)
    ShiftCamera("agentview", (0.0, 0.0, 0.0), 0.0, 7.0).apply(WORLD)
    wide = float(WORLD.model.camera("agentview").fovy[0])
    shift.reverted(evidence).apply(WORLD)
    assert WORLD.model.camera("agentview").fovy[0] == wide
    assert WORLD.model.camera("agentview").pos.tolist() == evidence.before["camera_position_m"]


def test_a_filter_is_removed_once_and_the_others_stay() -> None:
    WORLD.reset(0)
    glare, light = SetGlare(0.5, 0.5, 0.5, 0.3), SetLighting(0.5)
    glare.apply(WORLD)
    evidence = light.apply(WORLD)
    back = light.reverted(evidence)
    back.apply(WORLD)
    assert [type(one).__name__ for one, _ in WORLD.filters] == ["Glare"]
    with pytest.raises(ChangeError, match="not active"):
        back.apply(WORLD)


def test_evidence_of_another_change_is_refused() -> None:
    WORLD.reset(0)
    evidence = SetLighting(0.5).apply(WORLD)
    with pytest.raises(ChangeError, match="evidence"):
        MoveObject(SEEN[0], (0.1, 0.0, 0.0)).reverted(evidence)


def test_a_record_does_not_hold_what_a_reversal_needs_and_the_error_says_so() -> None:
    WORLD.reset(0)
    change = SetInstruction("other words")
    evidence = change.apply(WORLD)
    assert "saved" not in evidence.to_dict()
    read = Evidence(evidence.operation, evidence.factors, evidence.before, evidence.after)
    with pytest.raises(ChangeError, match="from a record"):
        change.reverted(read)


def test_a_reversal_is_all_or_nothing_and_final() -> None:
    WORLD.reset(0)
    change = MoveObject(SEEN[0], (0.05, 0.0, 0.0))
    back = change.reverted(change.apply(WORLD))
    assert isinstance(back, Reversal)
    assert back.scaled(1.0) is back
    assert back.scaled(0.0) == Nothing()
    with pytest.raises(ChangeError, match="all or nothing"):
        back.scaled(0.5)
    with pytest.raises(ChangeError, match="Apply move_object anew"):
        back.reverted(back.apply(WORLD))
    assert hash(back) == hash(change.reverted(change.apply(WORLD)))
