"""Build the package's own environment and reset it, around its defects.

Its wrapper's ``reset`` retries forever, whatever goes wrong, and a placement that fails stops in the
debugger. Here the environment inside the wrapper is reset, a fixed number of times at most. It draws
from NumPy's global generator, which is seeded before and put back afterwards.
"""

from __future__ import annotations

import contextlib
import importlib
import pdb
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.importing import imported
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.worlds.global_generators import global_generators_restored

_NO_MEMORY = "Could not allocate memory"
"""MuJoCo's words where the memory of the process is at its limit."""

ASSET_CACHE_BYTES = 3 * 2**29
"""Memory that MuJoCo may keep for textures and meshes that it has decoded. Those of LIBERO's four suites take
1.1 GB, and scenes are built in half the time where all of them stay. Its own limit is 0.5 GB, which two
suites fill; it keeps those used most, so that a third suite is decoded again for each scene."""

MAX_RESETS = 10
"""Attempts to lay out a scene; the authors' runners allow as many."""


@dataclass(frozen=True)
class Built:
    """An environment after its reset."""

    wrapper: Any
    """The package's ``ControlEnv``."""
    env: Any
    """The environment inside it, a robosuite one."""


def build(installation: Installation, bddl: Path | str, seed: int, *, rebuild: bool = True) -> Built:
    """Build the environment of a task and reset it once, as an evaluation with this seed would.

    No image is rendered and no OpenGL context is made.

    Args:
        bddl: The task's BDDL file, or a name that the package's wrapper understands.
        seed: Seed of the reset, which places the fixtures.
        rebuild: True if the reset builds the scene a second time (robosuite's ``hard_reset``), which is
            LIBERO's default. The authors' runner switches it off. Where a task begins with something
            opened, closed or turned on, a second building makes the reset draw one more random number,
            and the fixtures stand elsewhere.

    Raises:
        SubstrateError: The scene cannot be built or laid out.
        MemoryError: There is no memory for it.
    """
    _keep_assets()
    with _forgetting_the_document(), imported(installation), global_generators_restored(), _no_debugger():
        wrappers = importlib.import_module(f"{installation.inner}.envs.env_wrapper")
        randomization_error = importlib.import_module("robosuite.utils.errors").RandomizationError
        try:
            np.random.seed(seed)  # noqa: NPY002 - building lays a scene out as well, which may fail
            wrapper = _retried(
                lambda: wrappers.ControlEnv(
                    bddl_file_name=str(bddl), use_camera_obs=False, has_offscreen_renderer=False
                ),
                randomization_error,
            )
            env = wrapper.env
            env.hard_reset = rebuild
            env.seed(seed)
            _retried(env.reset, randomization_error)
        except SubstrateError:
            raise
        except randomization_error as error:
            raise SubstrateError(
                f"The scene of {Path(bddl).name} could not be laid out in {MAX_RESETS} attempts: {error}"
            ) from error
        except Exception as error:  # the package raises whatever it likes
            if _NO_MEMORY in str(error):
                raise MemoryError(str(error)) from error
            task = Path(bddl).name
            missing = _missing(error, installation, task)
            if missing:
                raise SubstrateError(missing) from None
            raise SubstrateError(
                f"The environment of {task} could not be built by {installation}: "
                f"{type(error).__name__}: {error}"
            ) from error
    return Built(wrapper, env)


def _keep_assets() -> None:
    import mujoco

    if hasattr(mujoco, "mj_setCacheCapacity"):  # not in all versions that play
        mujoco.mj_setCacheCapacity(mujoco.mj_getCache(), ASSET_CACHE_BYTES)


@contextlib.contextmanager
def _forgetting_the_document() -> Iterator[None]:
    """Let MuJoCo forget after the block what it was made of, 350 to 410 MB of textures and meshes.

    It keeps the last document of a process, to save it, which nobody here does. A tiny one takes its place.
    """
    import mujoco

    try:
        yield
    finally:
        mujoco.MjModel.from_xml_string("<mujoco/>")


def _missing(error: Exception, installation: Installation, task: str) -> str:
    """Return what an installation lacks for a task, with the cure; empty where the error is another."""
    named = re.search(r"'(.+?)'", str(error))
    if named is not None and Path(named.group(1)).is_relative_to(installation.assets):
        return (
            f"{installation} lacks {named.group(1)!r}, which the scene of {task} is made of: "
            f"{installation.assets_cure}."
        )
    if named is not None and isinstance(error, KeyError):
        return (
            f"{installation} knows no {named.group(1)!r}, which {task} asks for. Play it with the LIBERO "
            "that it was made for (pytest --libero-max-libero, libero-max --libero)."
        )
    return ""


def _retried(action: Callable[[], Any], randomization_error: type[Exception]) -> Any:
    for _ in range(MAX_RESETS - 1):
        with contextlib.suppress(randomization_error):
            return action()
    return action()


@contextlib.contextmanager
def _no_debugger() -> Iterator[None]:
    """Let a failed placement raise its error without stopping in the debugger."""
    original = pdb.set_trace
    pdb.set_trace = _carry_on
    try:
        yield
    finally:
        pdb.set_trace = original


def _carry_on(*arguments: Any, **keywords: Any) -> None:
    print("libero: a placement failed; trying again", file=sys.stderr)
