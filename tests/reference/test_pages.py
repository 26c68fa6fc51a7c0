from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.reference.api import MODULES
from pytest_libero_max.reference.worlds import OBSERVATIONS
from pytest_libero_max.worlds.contract import Substrate


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_exists_and_has_a_docstring(module: str) -> None:
    for name in MODULES[module].names:
        assert getattr(import_module(module), name).__doc__, f"{module}.{name}"


def test_an_observation_holds_what_the_page_of_the_worlds_says(substrate: Substrate) -> None:
    world = substrate.world(load_track("smoke").cases[0])
    world.reset(0)
    seen = world.observe(size=64)
    assert seen.keys() == OBSERVATIONS.keys()
    for name, (shape, dtype, _) in OBSERVATIONS.items():
        assert str(np.shape(seen[name])) == shape.replace("size", "64"), name
        assert str(seen[name].dtype) == dtype, name
