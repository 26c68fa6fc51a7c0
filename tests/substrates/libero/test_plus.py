from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.installation import Installation, find_installation
from pytest_libero_max.substrates.libero.package_env import Built
from pytest_libero_max.substrates.libero.plus import _Noise, noise_of, plus_task
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from tests.substrates.libero.data import DATA
from tests.substrates.libero.reference import Reference, assert_same
from tests.substrates.libero.test_installation import checkout
from tests.worlds.states import random_actions

PLUS = os.environ.get("LIBERO_MAX_TEST_PLUS", "")
needs_plus = pytest.mark.skipif(
    not PLUS, reason="needs a checkout of LIBERO-Plus; name its folder in LIBERO_MAX_TEST_PLUS"
)

BASE = "pick_up_the_milk_and_place_it_in_the_basket"
NAMES = (
    "_table_3",
    "_tb_7",
    "_light_12",
    "_add_4",
    "_level2_sample3",
    "_language_9_view_0_0_100_0_0_initstate_0",
    "_view_0_0_100_0_0_initstate_17",
    "_view_350_15_120_4_356_initstate_0",
    "_view_0_0_100_0_0_initstate_0_noise_33",
)


@pytest.fixture
def registry(tmp_path: Path) -> Installation:
    table = {"libero_object": [BASE + suffix for suffix in NAMES]}
    files = {
        "libero/libero/benchmark/task_classification.json": "{}",
        "libero/libero/benchmark/libero_suite_task_map.py": f"libero_task_map = {json.dumps(table)}",
        f"libero/libero/init_files/libero_object/{BASE}.pruned_init": "",
    }
    for suffix in NAMES:
        stem = (BASE + suffix).partition("_view_")[0]
        files[f"libero/libero/bddl_files/libero_object/{stem}.bddl"] = "(:language  Fetch the\n  milk)"
    for suffix in ("_add_4", "_level2_sample3"):
        files[f"libero/libero/init_files/libero_newobj/libero_object/{BASE}{suffix}.pruned_init"] = ""
    return find_installation(checkout(tmp_path, **files))


@pytest.mark.parametrize(("index", "suffix"), list(enumerate(NAMES)))
def test_names_are_taken_apart(registry: Installation, index: int, suffix: str) -> None:
    task = plus_task(registry, "libero_object", index)
    assert task.base == BASE
    assert task.bddl.name == f"{BASE}{suffix}.bddl"
    own_states = "add" in suffix or "level" in suffix
    assert task.states.name == f"{BASE}{suffix if own_states else ''}.pruned_init"
    words = " ".join(BASE.split("_"))
    if "language" in suffix:
        assert task.language == task.clean_language == "fetch the milk"
    else:
        assert task.language == words + suffix.replace("_", " ")
        assert task.clean_language == words


def test_another_registry_is_noticed(registry: Installation) -> None:
    assert plus_task(registry, "libero_object", 0, f"{BASE}_table_3").index == 0
    with pytest.raises(SubstrateError, match="registry"):
        plus_task(registry, "libero_object", 0, f"{BASE}_table_4")


def test_missing_states_are_named(registry: Installation) -> None:
    (registry.states / "libero_object" / f"{BASE}.pruned_init").unlink()
    with pytest.raises(SubstrateError, match=r"lacks .*basket\.pruned_init"):
        plus_task(registry, "libero_object", 0)


WRAPPER = """
import numpy as np

def fog(x, severity):
    depth = np.float_(np.random.uniform(0, 100))
    return np.array(x) * 0.0 + severity + depth

def zoom_blur(x, severity):
    return np.array(x) * 0.0 + np.fromstring(b"ab", np.uint8)[0]

class Wrapper:
    def __init__(self, noise):
        self.noise = noise

    def step(self, action):
        ...
"""


def wrapper(noise: int) -> Built:
    names: dict[str, Any] = {}
    exec(WRAPPER, names)
    return Built(names["Wrapper"](noise), SimpleNamespace())


def test_noise_is_seeded_and_leaves_the_other_camera_alone() -> None:
    noise = noise_of(wrapper(34), "scene")
    assert noise is not None
    image = np.full((8, 8, 3), 200, dtype=np.uint8)
    np.random.seed(5)  # noqa: NPY002
    expected = np.random.random()  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    seen = [noise(image, "agentview", step) for step in (1, 1, 2)]
    assert np.array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])
    assert np.array_equal(noise(image, "robot0_eye_in_hand", 1), image)
    assert np.array_equal(noise(image, "agentview", 0), image)
    assert np.random.random() == expected  # noqa: NPY002


def test_the_number_says_kind_and_level() -> None:
    noise = noise_of(wrapper(30), "scene")
    assert noise is not None
    assert (noise(np.zeros((4, 4, 3), dtype=np.uint8), "agentview", 3) == ord("a")).all()
    assert noise_of(wrapper(0), "scene") is None
    assert noise_of(Built(SimpleNamespace(), SimpleNamespace()), "scene") is None


@needs_plus
@pytest.mark.parametrize(
    ("suite", "index"), [("libero_spatial", 610), ("libero_object", 248), ("libero_object", 1042)]
)
def test_virtual_names_are_those_of_the_packages_own_step(suite: str, index: int) -> None:
    plus = find_installation(Path(PLUS), assets=DATA / "assets")
    substrate = LiberoSubstrate([plus])
    world = substrate.plus_world(suite, index, 195)
    reference = Reference(plus, plus_task(plus, suite, index), 195, images=True)
    world.reset(0)
    reference.start(world.initial_state(0))
    assert_same(world, reference, "start")
    for number, action in enumerate(random_actions(index, 4)):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")
    substrate.close()


@needs_plus
def test_both_installations_play_in_one_process(installation: Installation) -> None:
    plus = find_installation(Path(PLUS), assets=DATA / "assets")
    substrate = LiberoSubstrate([installation, plus])
    worlds = [substrate.task_world("libero_object", 0, 195), substrate.plus_world("libero_object", 248, 195)]
    digests = []
    for _ in range(2):
        for world in worlds:
            world.reset(0)
        for action in random_actions(0, 5):
            for world in worlds:
                world.step(action)
        digests.append([world.digest() for world in worlds])
    assert digests[0] == digests[1]
    assert digests[0][0] != digests[0][1]
    assert worlds[0].language != worlds[1].language
    substrate.close()


def test_an_image_that_is_too_small_for_the_packages_noise_is_refused() -> None:
    def glass_blur(picture: Any, severity: int) -> Any:
        return np.array(picture)[223]

    noise = _Noise(glass_blur, 1, "scene")
    with pytest.raises(SubstrateError, match=r"glass_blur .* 128 px"):
        noise(np.zeros((128, 128, 3), dtype=np.uint8), "agentview", 1)
