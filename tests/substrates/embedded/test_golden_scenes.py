"""Every embedded scene is what it was, by the values of what is compiled and decided."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import pytest_libero_max
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate, EmbeddedWorld
from pytest_libero_max.worlds.scene_digest import combined
from tests.mujoco_line import of_the_reference
from tests.substrates.embedded.golden_scenes import (
    TASKS,
    differing_fields,
    fields_of,
    golden,
    variations,
    versions,
    world_of,
)


@pytest.fixture(scope="module")
def kept() -> Any:
    kept = golden()
    if kept["versions"] != versions():
        pytest.skip(f"the digests are of {kept['versions']}, here are {versions()}")
    return kept


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


def require_equal(kept: Any, name: str, fields: dict[str, str]) -> None:
    if combined(fields) != kept["scenes"][name]:
        named = differing_fields(kept, name, fields) if kept["fields"] else ["not kept of this line"]
        different = [f"scene {name}, field {field}" for field in named]
        pytest.fail(
            "\n  ".join(["Not what it was:", *different])
            + "\nIf that is meant, raise RULES_VERSION (makers/construction/examiner.py) and write the "
            "digests again: python -m tests.substrates.embedded.golden_scenes"
        )


@pytest.mark.parametrize("name", [*TASKS, *variations()])
def test_a_scene_is_what_it_was(kept: Any, substrate: EmbeddedSubstrate, name: str) -> None:
    require_equal(kept, name, fields_of(world_of(substrate, name)))


def test_all_scenes_are_kept(kept: Any) -> None:
    assert list(kept["scenes"]) == [*TASKS, *variations()]


@of_the_reference
def test_another_friction_of_one_object_is_named_by_scene_and_field(kept: Any) -> None:
    scene = build_scene("libero_goal", 3)
    document = ET.fromstring(scene.mjcf)
    geom = next(geom for geom in document.iterfind(".//body[@name='wine_bottle_1_main']/geom[@friction]"))
    geom.set("friction", "0.96 0.3 0.1")
    world = EmbeddedWorld(replace(scene, mjcf=ET.tostring(document, encoding="unicode")))
    with pytest.raises(pytest.fail.Exception) as error:
        require_equal(kept, "libero_goal/3", fields_of(world))
    world.close()
    assert "libero_goal/3, field model.geom_friction" in str(error.value)


_FIELDS = """
import json
from tests.substrates.embedded.golden_scenes import *
substrate = EmbeddedSubstrate()
print(json.dumps({name: fields_of(world_of(substrate, name)) for name in ("libero_goal/3", "libero_10/2")}))
"""


def test_a_module_with_another_name_changes_no_digest(tmp_path: Path, substrate: EmbeddedSubstrate) -> None:
    package = tmp_path / "pytest_libero_max"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(pytest_libero_max.__file__).parent, package, ignore=ignored)
    shutil.copytree(Path(__file__).parents[2], tmp_path / "tests", ignore=ignored)
    for old, new in (("predicates", "rules"), ("placement", "layout")):
        (package / f"substrates/embedded/{old}.py").rename(package / f"substrates/embedded/{new}.py")
        for path in package.rglob("*.py"):
            text = path.read_text()
            path.write_text(
                text.replace(f"substrates.embedded.{old} import", f"substrates.embedded.{new} import")
            )
    output = subprocess.run(
        [sys.executable, "-c", _FIELDS],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    for name, fields in json.loads(output).items():
        assert fields == fields_of(world_of(substrate, name))
