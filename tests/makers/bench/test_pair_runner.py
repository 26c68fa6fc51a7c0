"""The pair that is timed: both loops must arrive at the same state."""

from dataclasses import replace

import numpy as np
import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli import main
from pytest_libero_max.errors import SimulatorError
from pytest_libero_max.makers.bench.pair_runner import Hovering, case_of, final_positions
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
from pytest_libero_max.tasks.suites import LIBERO_SUITES
from tests.pairing.actors import shorten


def test_the_final_state_is_that_of_the_last_arm_wherever_the_runner_left_the_world() -> None:
    cases = (case for case in load_track("original") if case.suite == "libero_spatial")
    case = shorten(next(case for case in cases if case.event.name == "camera_shift"))
    world = EmbeddedWorld(build_scene(case.suite, case.task_index))
    world.reset(case.init_state_index)
    policy = Hovering(world.position(case.event.entity) + np.array([0.0, 0.0, 0.15]))
    policy.spec = replace(policy.spec, cameras=())
    pair = measure_pair(case, world, policy)
    world.reset(0)
    final = final_positions(world, case, pair)
    assert world.steps == 10 + len(pair.base.actions)
    assert (final == world.data.qpos).all()
    with pytest.raises(SimulatorError, match="lead elsewhere"):
        final_positions(world, replace(case, init_state_index=case.init_state_index + 1), pair)
    world.close()


def test_every_scene_has_a_case_to_time_and_the_original_one_where_there_is_one() -> None:
    frozen = {case.item_id for case in load_track("original").cases}
    assert case_of("libero_spatial", 0).item_id in frozen
    for suite in LIBERO_SUITES:
        for task_index in range(10):
            case = case_of(suite, task_index)
            assert (case.suite, case.task_index, case.event.name) == (suite, task_index, "camera_shift")


def test_without_repeats_steps_are_measured_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["dev", "bench", "pairs", "--scene=libero_10/2", "--steps=2", "--repeats=0"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("libero_10/2: 2 control steps")
    assert "pair runner" not in out
