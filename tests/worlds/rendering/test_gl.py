from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pytest_libero_max.errors import OptionError, SimulatorError
from pytest_libero_max.worlds.rendering import gl

STEP = """
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedWorld
world = EmbeddedWorld(build_scene("libero_object", 0))
world.step((0.1, 0, 0, 0, 0, 0, -1))
print("digest", world.digest().hex())
"""
TINY_WORLD = "from pytest_libero_max.substrates.tiny.world import TinyWorld\nworld = TinyWorld()\n"
LOOK = "print('image', world.observe(['agentview'], 32)['agentview_image'].shape)\n"
WITHOUT_LIBRARIES = """
import ctypes
from pytest_libero_max.worlds.rendering import gl
gl._library = lambda *names: None
"""


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return subprocess.run(
        [sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True, timeout=180
    )


def digest_of(output: str) -> str:
    return next(line for line in output.splitlines() if line.startswith("digest"))


def test_stepping_needs_no_opengl_and_gives_the_same_bits() -> None:
    blind = run(WITHOUT_LIBRARIES + STEP)
    seeing = run(STEP + LOOK)
    assert blind.returncode == 0, blind.stderr
    assert seeing.returncode == 0, seeing.stderr
    assert "image (32, 32, 3)" in seeing.stdout
    assert digest_of(blind.stdout) == digest_of(seeing.stdout)
    assert (blind.stderr, seeing.stderr) == ("", "")


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """The choice of a backend, still to be made, for one test."""
    for name in (gl.VARIABLE, gl.PLATFORM):
        monkeypatch.delenv(name, raising=False)
    gl._choice.cache_clear()
    yield monkeypatch
    gl._choice.cache_clear()


@pytest.mark.parametrize(
    ("backend", "packages"),
    [
        ("", ("libegl1 libgl1-mesa-dri libopengl0", "libosmesa6")),
        ("osmesa", ("libosmesa6",)),
        ("egl", ("libegl1 libgl1-mesa-dri libopengl0",)),
    ],
)
def test_an_image_without_opengl_names_the_packages_to_install(
    fresh: pytest.MonkeyPatch, backend: str, packages: tuple[str, ...]
) -> None:
    fresh.setattr(gl, "_library", lambda *names: None)
    fresh.setenv(gl.VARIABLE, backend)
    assert gl.prepare() == "disable"
    with pytest.raises(SimulatorError) as error:
        gl.require()
    assert all(f"`{package}`" in str(error.value) for package in packages)
    assert str(error.value).count("`") == 2 * len(packages)


def test_renouncing_images_is_honoured() -> None:
    code = TINY_WORLD + "print(world.digest())\n"
    assert run(code, MUJOCO_GL="disable").returncode == 0
    refused = run(code + LOOK, MUJOCO_GL="off")
    assert "MUJOCO_GL='off'" in refused.stderr


@pytest.mark.parametrize("word", ["glfw", "osmessa"])
def test_a_word_that_is_no_backend_is_refused_with_the_valid_ones(
    fresh: pytest.MonkeyPatch, word: str
) -> None:
    fresh.setenv(gl.VARIABLE, word)
    with pytest.raises(OptionError, match=f"MUJOCO_GL='{word}' .*disable, egl, osmesa|Did you mean") as error:
        gl.prepare()
    assert ("Did you mean 'osmesa'" in str(error.value)) == (word == "osmessa")


@pytest.mark.parametrize("backend", gl.OFFSCREEN)
def test_an_explicit_backend_is_kept(fresh: pytest.MonkeyPatch, backend: str) -> None:
    fresh.setenv(gl.VARIABLE, backend)
    assert gl.prepare() == (backend if gl.loads(backend) else "disable")


def test_robosuite_is_imported_without_a_word() -> None:
    result = run("from pytest_libero_max.worlds import stepping")
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_robosuite_is_imported_without_a_word_where_modules_were_taken_back() -> None:
    """As pytest's own tests of plugins do: the backend stays settled, and robosuite's macros are gone."""
    result = run(
        "import sys\n"
        "from pytest_libero_max.worlds.rendering import gl\n"
        "gl.prepare()\n"
        "del sys.modules['robosuite.macros_private']\n"
        "gl.import_robosuite()"
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_the_plugin_and_the_cases_load_no_simulator() -> None:
    code = (
        "import sys, pytest_libero_max, pytest_libero_max.benchmark.cases\n"
        "import pytest_libero_max.worlds.contract\n"
        "print([name for name in ('mujoco', 'robosuite', 'numba', 'cv2', 'scipy') if name in sys.modules])"
    )
    assert run(code).stdout.strip() == "[]"


def test_code_of_others_that_nothing_has_compiled_is_imported_where_warnings_are_errors(
    tmp_path: Path,
) -> None:
    code = "import warnings; warnings.simplefilter('error'); import pytest_libero_max.worlds.stepping"
    result = run(code, PYTHONPYCACHEPREFIX=str(tmp_path), PYTHONDONTWRITEBYTECODE="1")
    assert result.returncode == 0, result.stderr


REQUIRE = "from pytest_libero_max.worlds.rendering import gl\ngl.check()\ngl.require()\n"


@pytest.mark.parametrize("platform", ["glx", "osmesa"])
@pytest.mark.parametrize("backend", [{}, {"MUJOCO_GL": "egl"}], ids=["unset", "egl"])
def test_a_platform_of_pyopengl_that_keeps_a_working_backend_out_is_named_with_its_cure(
    platform: str, backend: dict[str, str]
) -> None:
    others_work = (
        "gl._library = lambda *names: None if 'OSMesa' in names[0] else 1\ngl.egl.answers = lambda: True\n"
    )
    first, rest = REQUIRE.split("\n", 1)
    result = run(f"{first}\n{others_work}{rest}", PYOPENGL_PLATFORM=platform, **backend)
    message = result.stderr.splitlines()[-1]
    for part in (f"PYOPENGL_PLATFORM={platform!r}", "MUJOCO_GL", "'egl'", "Unset PYOPENGL_PLATFORM"):
        assert part in message
    assert "Install" not in message
