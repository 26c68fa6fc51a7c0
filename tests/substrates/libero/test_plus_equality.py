"""LIBERO-Plus's categories as its own wrapper makes them: the same scene, state, picture and prompt.

Its package is the reference, unmodified, with the robosuite and NumPy that this project uses.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from types import ModuleType
from unittest import mock

import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.importing import imported
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.lacking import PlusNeeds, first_of, plus_category
from pytest_libero_max.substrates.libero.plus import plus_task
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.tasks import task_names
from pytest_libero_max.tasks.libero_tasks import SUITES
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES
from tests.substrates.libero.reference import PROPRIOCEPTION, Reference
from tests.substrates.libero.test_packages import pytestmark  # noqa: F401 - skips without the packages

SEED, PIXELS = 195, 256
CAMERAS = ("agentview", "robot0_eye_in_hand")
SAMPLE = int(os.environ.get("LIBERO_MAX_TEST_PLUS_TASKS", "1"))
"""Suites of which a task of each category is compared; 4 in the long version."""


def sample(installation: Installation, category: str) -> list[tuple[str, int]]:
    """A task of a category of each of some suites that plays here; where none does, one that does not."""
    suites = SUITES[PLUS_CATEGORIES.index(category) % len(SUITES) :] + SUITES
    needs, found = PlusNeeds.of(installation), []
    for suite in suites[: min(SAMPLE, len(SUITES))]:
        names = task_names(installation, suite)
        here = [index for index, name in enumerate(names) if plus_category(name) == category]
        playing = [index for index in here if not needs.lacking(names[index])]
        found.append((suite, (playing or here)[len(playing or here) // 2]))
    return found


@pytest.fixture(scope="module")
def substrate() -> LiberoSubstrate:
    return LiberoSubstrate()


@pytest.mark.parametrize("category", PLUS_CATEGORIES)
def test_scene_state_picture_and_prompt_are_those_of_its_own_wrapper(
    substrate: LiberoSubstrate, category: str
) -> None:
    installation = first_of(substrate.installations, "plus")
    assert installation is not None
    for suite, index in sample(installation, category):
        task = plus_task(installation, suite, index)
        if PlusNeeds.of(installation).lacking(task.name):
            with pytest.raises(SubstrateError, match=r"lacks '.*', which"):
                substrate.plus_world(suite, index, SEED)
            continue
        assert task.language == own_prompt(installation, suite, task.name)
        world = substrate.plus_world(suite, index, SEED)
        reference = Reference(installation, task, SEED, images=True, pixels=PIXELS)
        world.reset(0)
        for field in arrays(world.model) - {"tex_colorspace"}:
            ours, theirs = getattr(world.model, field), getattr(reference.model, field)
            same = np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f")
            assert same, f"{task.name}: {field}"
        reference.start(world.initial_state(0))
        assert np.array_equal(world.snapshot().physics, reference.state), task.name
        seen = world.observe(CAMERAS, PIXELS)
        for key in (*PROPRIOCEPTION, *(f"{camera}_image" for camera in CAMERAS)):
            assert np.array_equal(seen[key], reference.observation[key]), f"{task.name}: {key}"
        reference.close()


def arrays(model: object) -> set[str]:
    """The names of all arrays of a compiled model."""
    return {
        name
        for name in dir(model)
        if not name.startswith("_") and isinstance(getattr(model, name), np.ndarray)
    }


def own_prompt(installation: Installation, suite: str, name: str) -> str:
    """What LIBERO-Plus's benchmark tells a policy, by its own function."""
    torch = {} if "torch" in sys.modules else {"torch": ModuleType("torch")}  # it loads states with it
    with imported(installation), mock.patch.dict(sys.modules, torch):
        benchmark = importlib.import_module(f"{installation.inner}.benchmark")
        prompt: str = benchmark.grab_language_from_filename(suite, f"{name}.bddl")
    return re.sub(r"\s+", " ", prompt)
