from __future__ import annotations

import json

import numpy as np

from pytest_libero_max.pairing.scene_fingerprints import SCENE, START, scene_fingerprints
from pytest_libero_max.substrates.tiny.world import TinyWorld


def test_the_fingerprints_of_a_pair_name_the_scene_and_tell_the_starts_apart() -> None:
    world = TinyWorld()
    world.step(np.ones(7))
    first, again, other = (scene_fingerprints(world, init) for init in (0, 0, 1))
    assert first == again
    assert first[SCENE] == other[SCENE]
    assert first[SCENE].startswith("tiny/0 ")
    assert first[START] != other[START]
    assert json.loads(json.dumps(first)) == first
    assert world.steps == 0
    world.close()
