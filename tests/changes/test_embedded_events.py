"""The events of the original track in the scenes they are meant for."""

from collections.abc import Iterator

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.worlds.robot import CAMERAS
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

ORIGINAL = load_track("original").cases
ACTIONS = [(0.3, -0.2, -0.5, 0.1, 0.0, -0.1, -1.0)] * 4
SEEN_ONLY = ("illumination_switch", "camera_shift", "visual_theme_switch", "sensor_noise_onset")

one_of_each = pytest.mark.parametrize(
    "case",
    {(case.event.name, case.event.variant): case for case in ORIGINAL}.values(),
    ids=lambda case: case.item_id,
)


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


@one_of_each
def test_an_event_touches_what_it_declares_and_a_reset_undoes_it(
    substrate: EmbeddedSubstrate, case: Case
) -> None:
    world = substrate.world(case)
    world.reset(case.init_state_index)
    fresh = full_state(world)
    change = set_up(world, case.event)
    play(world, ACTIONS)
    before = full_state(world)
    poses = {name: pose_bytes(world, name) for name in world.entities}
    change.apply(world)
    after = full_state(world)
    moved = {factor.removeprefix("pose:") for factor in change.factors if factor.startswith("pose:")}
    assert {name for name in world.entities if pose_bytes(world, name) != poses[name]} == moved
    if case.event.name in SEEN_ONLY:
        assert not differing(before, after) & {"physics", "qpos", "qvel", "controller", "parked", "steps"}
        assert differing(before, after)
    for array, slices in (("qpos", position_slices(world)), ("qvel", velocity_slices(world))):
        for name in moved:
            before[array][slices[name]] = after[array][slices[name]]
        assert same(before[array], after[array])
    play(world, ACTIONS)
    world.reset(case.init_state_index)
    assert differing(fresh, full_state(world)) == set()


@one_of_each
def test_an_event_is_seen_by_every_camera_it_concerns(substrate: EmbeddedSubstrate, case: Case) -> None:
    world = substrate.world(case)
    world.reset(case.init_state_index)
    change = set_up(world, case.event)
    before = world.observe(size=128)
    change.apply(world)
    after = world.observe(size=128)
    seen = {
        camera: float(np.abs(after[f"{camera}_image"].astype(int) - before[f"{camera}_image"]).mean())
        for camera in CAMERAS
    }
    assert seen["agentview"] > 0.1
    if case.event.name in ("illumination_switch", "sensor_noise_onset"):
        assert seen["robot0_eye_in_hand"] > 5.0
    if case.event.name == "camera_shift":
        assert seen["robot0_eye_in_hand"] == 0.0
