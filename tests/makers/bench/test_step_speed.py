from __future__ import annotations

import re
import subprocess
import sys

import numpy as np

from pytest_libero_max.makers.bench.step_speed import StepTimes, measure_stepping
from pytest_libero_max.substrates.embedded.env import SceneEnv
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.robot import CAMERAS


def times(**changed: float | None) -> StepTimes:
    values = {
        "scene": "libero_spatial/0",
        "steps": 60,
        "lean": 1.5,
        "robosuite": 6.0,
        "robosuite_images": 30.0,
        "bare": 1.0,
        "passes": 2.5,
        "image": 7.0,
        "size": 256,
        "contacts": 20,
    }
    return StepTimes(**{**values, **changed})  # type: ignore[arg-type]


def test_the_table_says_what_was_measured() -> None:
    first, *rows = times().lines()
    assert first.startswith("libero_spatial/0: 60 ")
    times_ms = [float(value) for row in rows for value in re.findall(r" ([\d.]+) ms", row)]
    assert times_ms == [1.5, 1.0, 0.5, 6.0, 2.5, 3.5, 30.0, 7.0]
    assert ["667 steps/s" in rows[0], " 1.50 times" in rows[1], " 4.0 times" in rows[3]] == [True] * 3


def test_without_images_their_rows_are_left_out() -> None:
    measured = times(robosuite_images=None, image=None)
    assert len(measured.lines()) == 7


def test_a_measurement_ends_without_a_word_from_the_driver() -> None:
    code = (
        "from pytest_libero_max.makers.bench.step_speed import measure_stepping\n"
        "from pytest_libero_max.substrates.tiny.world import TinyWorld\n"
        "TinyWorld().observe(size=16)\n"  # our context is made first, so the driver closes it last
        "measure_stepping('libero_object', 0, steps=1, size=32)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=180)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_a_short_measurement_of_the_real_thing() -> None:
    measured = measure_stepping("libero_object", 0, steps=4, size=64)
    assert measured.scene == "libero_object/0"
    assert measured.bare > 0
    assert 0 < measured.lean < measured.robosuite
    assert measured.image is None or measured.image > 0


def test_robosuite_takes_none_of_our_pictures_with_it() -> None:
    world = TinyWorld()
    world.observe(size=32)
    env = SceneEnv(build_scene("libero_object", 0), CAMERAS, 32)
    before = world.observe(size=32)
    env.close()  # our context is current
    after = world.observe(size=32)
    world.close()
    for camera in CAMERAS:
        assert np.array_equal(after[f"{camera}_image"], before[f"{camera}_image"])
