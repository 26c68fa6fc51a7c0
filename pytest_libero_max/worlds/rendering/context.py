"""The GL context of this process, and the fingerprints of what draws. Importing this imports no simulator."""

from __future__ import annotations

import atexit
import ctypes
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from pytest_libero_max.errors import LiberoMaxError, SimulatorError
from pytest_libero_max.worlds.rendering import egl, gl

BACKEND, DEVICE = "gl", "gl_device"
"""Fingerprints: the backend (``egl``, ``osmesa``), and the device of EGL."""

RENDERER, VERSION = "gl_renderer", "gl_version"
"""Fingerprints: ``GL_RENDERER`` and ``GL_VERSION`` of the context that draws. They are missing in pairs of a
policy without cameras, and in records of earlier versions."""

RENDERING = (BACKEND, DEVICE, RENDERER, VERSION)

_GL_RENDERER, _GL_VERSION = 0x1F01, 0x1F02
_VECTOR_WIDTH = re.compile(r", \d+ bits\)$")
"""Width of the vectors of llvmpipe, which is the processor's: pixels do not depend on it."""


def fingerprint(images: bool = False) -> dict[str, str]:
    """Return the backend and the device, for the record: pictures depend on both.

    Args:
        images: True to return renderer and version as well, on which pictures depend as much. It opens the
            context. Without a backend there are none.

    Raises:
        OptionError: ``MUJOCO_EGL_DEVICE_ID`` names a device that does not exist.
        SimulatorError: None of EGL's devices answers, or the driver gives no context.
    """
    backend = gl.prepare()
    device = {DEVICE: egl.chosen()[0].name} if backend == "egl" else {}
    return {BACKEND: backend, **device, **(_renderer() if images and backend in gl.OFFSCREEN else {})}


def drawn_by(fingerprints: Mapping[str, str]) -> str | None:
    """Return what drew the images of a pair, in words; None where it is not recorded.

    For example ``llvmpipe (LLVM 15.0.6), OpenGL 4.5 (Compatibility Profile) Mesa 22.3.6``.
    """
    if RENDERER not in fingerprints or VERSION not in fingerprints:
        return None
    return f"{fingerprints[RENDERER]}, OpenGL {fingerprints[VERSION]}"


def renderers(fingerprints: Iterable[Mapping[str, str]]) -> Counter[str]:
    """Return the number of pairs by what drew their images, without those that do not say."""
    return Counter(name for pair in fingerprints if (name := drawn_by(pair)))


@cache
def _renderer() -> dict[str, str]:
    shared_context().make_current()
    from OpenGL.platform import PLATFORM  # the library of the backend; importing OpenGL.GL takes 50 ms more

    get_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(("glGetString", PLATFORM.GL))
    renderer, version = (
        (get_string(name) or b"unnamed").decode(errors="replace") for name in (_GL_RENDERER, _GL_VERSION)
    )
    return {RENDERER: _VECTOR_WIDTH.sub(")", renderer), VERSION: version}


@cache
def shared_context() -> Any:
    """Return the GL context of this process; it needs no size, as all drawing is into framebuffer objects.

    Raises:
        SimulatorError: No backend loads, or the driver gives no context; says what to do.
    """
    backend = gl.require()
    try:
        if backend == "egl":
            from mujoco.egl import GLContext

            with egl.asked_for(str(egl.chosen()[0].number)):
                context = GLContext(1, 1)
        else:
            from mujoco.osmesa import GLContext

            context = GLContext(1, 1)
        context.make_current()
    except LiberoMaxError:
        raise
    except Exception as error:  # whatever a driver raises, it means that images cannot be had
        raise SimulatorError(f"The OpenGL backend {backend!r} gives no context: {error}") from error
    atexit.register(_free, context)
    return context


def _free(context: Any) -> None:
    """Free the GL context before the interpreter does, which would come too late and complain about it."""
    try:
        context.free()
    except Exception:  # robosuite, where it has rendered as well, has closed the display already
        context._context = None
