"""Choosing the OpenGL backend, once per process and before MuJoCo is imported.

MuJoCo and robosuite read ``MUJOCO_GL`` while they are imported, and an import with a backend whose
libraries are missing fails as a whole. So every module of this room that needs MuJoCo calls
:func:`prepare` first: it settles the variable on something that loads. Where nothing loads, physics
works all the same, and :func:`require` says what to install when an image is asked for.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import sys
import types
import warnings
from collections.abc import Iterator, Sequence
from functools import cache
from types import MappingProxyType

from pytest_libero_max.errors import OptionError, SimulatorError, did_you_mean
from pytest_libero_max.machine import named_user_cache
from pytest_libero_max.worlds.rendering import egl

VARIABLE = "MUJOCO_GL"
PLATFORM = "PYOPENGL_PLATFORM"
"""Variable of PyOpenGL, through which MuJoCo draws; MuJoCo refuses a value that is not its backend."""

OFFSCREEN = ("egl", "osmesa")
"""Backends that need no display, in the order in which they are tried."""

DISABLED = ("disable", "disabled", "off", "false", "0")
"""Values of ``MUJOCO_GL`` that switch images off; the first is the one that we write."""

_PACKAGES = MappingProxyType({"egl": "libegl1 libgl1-mesa-dri libopengl0", "osmesa": "libosmesa6"})


def prepare() -> str:
    """Settle ``MUJOCO_GL`` and robosuite's macros; return the name of the backend, or ``disable``.

    An explicit ``MUJOCO_GL`` is kept if its libraries load. Otherwise EGL is tried, then OSMesa. The
    choice is made once: later changes of the environment have no effect on this process.

    Raises:
        OptionError: ``MUJOCO_GL`` is set to a word that is no backend for offscreen images.
    """
    _quiet_robosuite()
    return _choice()[0]


def check() -> None:
    """Check that an explicit ``MUJOCO_GL`` or ``MUJOCO_EGL_DEVICE_ID`` can draw. Settles nothing.

    For a process that only hands out the work, before anything is played.

    Raises:
        OptionError: It is no backend for offscreen images, or its libraries do not load, or there is no such
            device; says what to do.
        SimulatorError: The device does not answer.
    """
    wanted = _asked()
    if wanted in OFFSCREEN and not loads(wanted):
        raise OptionError(
            excluded((wanted,))
            or f"{VARIABLE}={wanted!r}, but its libraries do not load here. Install the Debian packages "
            f"`{_PACKAGES[wanted]}`, or unset {VARIABLE} to have a backend chosen."
        )
    if wanted not in ("osmesa", *DISABLED):
        egl.check()


def require() -> str:
    """Return the backend for images, or raise SimulatorError."""
    backend, asked = _choice()
    if backend in OFFSCREEN:
        return backend
    wanted = (asked,) if asked in OFFSCREEN else OFFSCREEN
    if asked not in DISABLED and (why := excluded(wanted)):
        raise SimulatorError(f"An image was asked for, but {why}")
    cures = " or ".join(f"`{_PACKAGES[name]}`" for name in wanted)
    raise SimulatorError(
        f"An image was asked for, but no OpenGL backend is available ({VARIABLE}={asked!r} at the start). "
        f"Stepping works without one; images need the Debian packages {cures}, and {VARIABLE} unset or one "
        f"of {', '.join(OFFSCREEN)}."
    )


def import_robosuite() -> None:
    """Import robosuite as :func:`prepare` settles it, whatever device draws; its loops are kept by Numba."""
    prepare()
    with egl.asked_for(None), named_user_cache(), unwarned():
        importlib.import_module("robosuite")


@contextlib.contextmanager
def unwarned() -> Iterator[None]:
    """Ignore warnings while the code of others is imported.

    Its source has escapes that Python warns of when it compiles them. Where a project's tests take warnings
    for errors, and the installer has compiled nothing beforehand, the import would fail.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@cache
def _choice() -> tuple[str, str]:
    """Return the backend settled on, and what ``MUJOCO_GL`` said before."""
    asked = _asked()
    tried = () if asked in DISABLED else (asked,) if asked else OFFSCREEN
    # With none, MuJoCo must be told so: it would raise while it is imported, and physics needs no backend.
    backend = next((name for name in tried if loads(name)), DISABLED[0])
    os.environ[VARIABLE] = backend
    return backend, asked


def _asked() -> str:
    """Return the backend that ``MUJOCO_GL`` names; empty where it is not set."""
    wanted = os.environ.get(VARIABLE, "").lower().strip()
    if wanted and wanted not in (*OFFSCREEN, *DISABLED):
        raise OptionError(
            f"{VARIABLE}={wanted!r} is no backend for offscreen images. "
            f"{did_you_mean(wanted, (*OFFSCREEN, DISABLED[0]))} Unset it to have one chosen."
        )
    return wanted


def loads(backend: str) -> bool:
    """Return True if the libraries of ``backend`` load, EGL answers, and PyOpenGL may draw with it."""
    return _platform() in ("", backend) and _libraries_load(backend)


def excluded(backends: Sequence[str]) -> str:
    """Return how PyOpenGL's variable keeps out a backend that would load; empty where it does not."""
    platform = _platform()
    loading = [name for name in backends if platform not in ("", name) and _libraries_load(name)]
    if not loading:
        return ""
    setting = (
        f"{VARIABLE}={loading[0]!r}" if len(backends) == 1 else f"{VARIABLE} is not set, {loading[0]!r} loads"
    )
    return (
        f"{PLATFORM}={platform!r} and {setting}: PyOpenGL draws with one platform in a process, and MuJoCo "
        f"with the same one. Unset {PLATFORM}, or set it to {loading[0]!r}."
    )


def _platform() -> str:
    return os.environ.get(PLATFORM, "").lower().strip()


def _libraries_load(backend: str) -> bool:
    if backend == "osmesa":
        return _library("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so") is not None
    return _library("libOpenGL.so.0", "libGL.so.1") is not None and egl.answers()


def _library(*names: str) -> ctypes.CDLL | None:
    for name in names:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    return None


def _quiet_robosuite() -> None:
    """Give robosuite the private macros it asks for: no warnings, no log file, no backend forced on it.

    robosuite replaces every ``MUJOCO_GL`` but two by ``egl`` while its macro for GPU rendering is on,
    which makes its import fail on a machine without EGL. It also makes results depend on a file that a
    user may have put beside it, so the macros that matter here are stated.
    """
    name = "robosuite.macros_private"
    if "robosuite" in sys.modules or name in sys.modules:
        return
    macros = types.ModuleType(name)
    vars(macros).update(
        SIMULATION_TIMESTEP=0.002,
        IMAGE_CONVENTION="opengl",
        ENABLE_NUMBA=True,
        CACHE_NUMBA=True,
        MUJOCO_GPU_RENDERING=False,
        CONSOLE_LOGGING_LEVEL=None,
        FILE_LOGGING_LEVEL=None,
    )
    sys.modules[name] = macros
