from __future__ import annotations

import numpy as np

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.makers.bench.genuine_speed import (
    GenuineTimes,
    measure_genuine,
    package_env,
    play_here,
    play_there,
)
from pytest_libero_max.substrates.libero.installation import find_installation
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.worlds.robot import ACTION_DIM
from tests.substrates.libero.data import DATA, needs_package


def test_the_table_states_the_ratios() -> None:
    times = GenuineTimes("LIBERO x", "case", 4.0, 12.0, 120.0, 6.0, 90.0, 460)
    text = "\n".join(times.lines())
    assert "250 steps/s" in text
    assert "3.0 times the" in text
    assert "10.00 pairs/min" in text
    assert "15.0 times the" in text


@needs_package
def test_steps_are_compared_with_the_packages_own() -> None:
    substrate = LiberoSubstrate([find_installation(assets=DATA / "assets")])
    times = measure_genuine(substrate, "libero_object", steps=6, repeats=0)
    assert times.package_ms > 1.5 * times.lean_ms
    assert times.images_ms > times.package_ms


@needs_package
def test_whole_rollouts_end_where_the_packages_own_end() -> None:
    substrate = LiberoSubstrate([find_installation(assets=DATA / "assets")])
    case = next(case for case in load_track("original") if case.suite == "libero_object")
    world, env = substrate.world(case), package_env(substrate, case, images=False)
    draw = np.random.default_rng(0)
    rollouts = [draw.uniform(-1.0, 1.0, (steps, ACTION_DIM)) for steps in (12, 9)]
    ends = play_here(world, case, rollouts)
    assert np.array_equal(play_there(env, world, case, rollouts), ends)
    assert not np.array_equal(ends[0], ends[1])
    env.close()
