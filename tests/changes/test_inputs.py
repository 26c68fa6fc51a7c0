from __future__ import annotations

import numpy as np
import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.changes import SwapImages
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.pairing.changing import begin_world
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate, EmbeddedWorld
from pytest_libero_max.worlds.robot import CAMERAS
from tests.changes.world_comparison import differing, full_state
from tests.substrates.libero.made_up import case_of


def test_images_of_another_task_are_those_of_its_own_first_query() -> None:
    suite = "libero_object"
    substrate = EmbeddedSubstrate()
    here, there = (case_of(None, suite, index) for index in (0, 1))
    begin_world(there, other := substrate.world(there))
    first = other.observe(CAMERAS, 64)
    for case in (here, next(case for case in load_track("smoke") if case.suite == suite)):
        begin_world(case, world := substrate.world(case))
        own, before = world.observe(CAMERAS, 64), full_state(world)
        SwapImages(CAMERAS[:1], 64, 64, suite, 1, 0).apply(world)
        assert differing(before, full_state(world)) <= {"filters"}
        world.step([0.5, 0.0, -0.5, 0.0, 0.0, 0.0, -1.0])
        shown = world.observe(CAMERAS, 64)
        assert np.array_equal(shown["agentview_image"], first["agentview_image"])
        assert not np.array_equal(shown["agentview_image"], own["agentview_image"])
        assert not np.array_equal(shown["robot0_eye_in_hand_image"], first["robot0_eye_in_hand_image"])
    begin_world(here, world := substrate.world(here))
    with pytest.raises(SubstrateError, match="task 0 of libero_object"):
        SwapImages(CAMERAS, 64, 64, suite, 0, 0).apply(world)
    with pytest.raises(SubstrateError, match="not a task of libero_object"):
        SwapImages(CAMERAS, 64, 64, suite, 10, 0).apply(world)
    substrate.close()


def test_a_world_without_a_substrate_knows_no_other_task() -> None:
    world = EmbeddedWorld(build_scene("libero_object", 0))
    with pytest.raises(SubstrateError, match="embedded/libero_object/0"):
        SwapImages(CAMERAS, 64, 64, "libero_object", 1, 0).apply(world)
    world.close()
