"""What a record says of the renderer, asked in processes of their own: the context is made once for each."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from pytest_libero_max.worlds.rendering import gl
from pytest_libero_max.worlds.rendering.context import drawn_by

ASK = """
import json, sys
from pytest_libero_max.worlds.rendering import context
before = context.fingerprint(), "mujoco" in sys.modules
print(json.dumps([*before, context.fingerprint(images=True)]))
"""


def asked(code: str = ASK, **environment: str) -> list[object]:
    kept = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True, timeout=180
    )
    assert done.returncode == 0, done.stderr
    found: list[object] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("backend", gl.OFFSCREEN)
def test_renderer_and_version_are_those_of_the_context_that_draws(backend: str) -> None:
    if not gl.loads(backend):
        pytest.skip(f"needs the libraries of {backend}")
    blind, simulator, seeing = asked(MUJOCO_GL=backend)
    assert not simulator  # no context is opened only to name a device
    assert isinstance(blind, dict)
    assert isinstance(seeing, dict)
    assert {"gl", "gl_renderer", "gl_version"} <= seeing.keys()
    assert blind == {key: value for key, value in seeing.items() if key not in ("gl_renderer", "gl_version")}
    own = (
        "import json\n"
        "from pytest_libero_max.worlds.rendering.renderer import require_images, shared_context\n"
        "require_images(); shared_context().make_current()\n"
        "from OpenGL import GL\n"
        "print(json.dumps([GL.glGetString(name).decode() for name in (GL.GL_RENDERER, GL.GL_VERSION)]))"
    )
    renderer, version = asked(own, MUJOCO_GL=backend)
    assert seeing["gl_version"] == version
    assert str(renderer).startswith(seeing["gl_renderer"].removesuffix(")"))


def test_the_width_of_a_processors_vectors_is_left_out() -> None:
    if not gl.loads("egl"):
        pytest.skip("needs EGL: the Debian packages libegl1 libgl1-mesa-dri libopengl0")
    wide, narrow = (asked(MUJOCO_GL="egl", LP_NATIVE_VECTOR_WIDTH=width)[2] for width in ("256", "128"))
    assert wide == narrow
    assert " bits" not in str(wide)


def test_without_a_backend_nothing_is_said_of_a_renderer() -> None:
    assert asked(MUJOCO_GL="disable") == [{"gl": "disable"}, False, {"gl": "disable"}]


def test_a_record_is_read_as_words_or_does_not_say() -> None:
    new = {"gl": "osmesa", "gl_renderer": "llvmpipe (LLVM 15.0.6)", "gl_version": "4.5 Mesa 22.3.6"}
    assert drawn_by(new) == "llvmpipe (LLVM 15.0.6), OpenGL 4.5 Mesa 22.3.6"
    assert drawn_by({"gl": "egl", "gl_device": "software"}) is None
