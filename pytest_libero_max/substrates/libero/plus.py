"""LIBERO-Plus: the tasks of its registry, and the sensor noise that its wrapper adds.

A name in the registry is a base task's name with a suffix that says what is varied. Some names are those of
a BDDL file; the others are virtual, and the package's wrapper takes them apart: a camera's place, a robot's
initial joints, a kind of noise.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.package_env import Built
from pytest_libero_max.substrates.libero.tasks import (
    Task,
    check_name,
    sentence,
    states_file,
    task_name,
    words_of,
)
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.global_generators import global_generators_restored

_LAYOUT = re.compile(r"_(?:add_\d+|(?:moved_)?level\d+_sample\d+)$")
_SUFFIX = re.compile(
    r"_(?:(?:table|tb|light|add)_\d+|(?:moved_)?level\d+_sample\d+|(?:language_\d+_)?view_[\d_]+_initstate_\d+.*)$"
)
_LANGUAGE = re.compile(r"_language_\d+_view_")

_NOISES = ("motion_blur", "gaussian_blur", "zoom_blur", "fog", "glass_blur")
_LEVELS = 10
_PROBE_PX = 256  # glass blur takes every image for one of 224 px and more


@dataclass(frozen=True)
class PlusTask(Task):
    """A task of LIBERO-Plus's registry."""

    base: str
    """Name of the task it varies."""

    @property
    def language(self) -> str:
        """The authors' prompt: rewritten words, or the whole name, which includes the variation."""
        return self.rewritten or sentence(self.name)

    @property
    def clean_language(self) -> str:
        return self.rewritten or sentence(self.base)

    @property
    def rewritten(self) -> str | None:
        """The words of a variation of the instruction, in lower case as LIBERO-Plus reads them."""
        if not _LANGUAGE.search(self.name):
            return None
        return words_of(self.bddl.with_name(f"{self.name.partition('_view_')[0]}.bddl")).lower()

    @property
    def source(self) -> str:
        return "-plus"


def plus_task(installation: Installation, suite: str, index: int, name: str | None = None) -> PlusTask:
    """Return a task by its place in the registry's own order, or raise SubstrateError.

    Args:
        suite: For example ``libero_spatial``.
        index: From 0.
        name: Name that it must have, where that is known.
    """
    listed = task_name(installation, suite, index)
    base = base_name(listed)
    folder = installation.bddl / suite
    if _LAYOUT.search(listed):
        states = states_file(installation.states / "libero_newobj" / suite / f"{listed}.pruned_init")
    else:
        states = states_file(installation.states / suite / f"{base}.pruned_init")
    task = PlusTask(suite, index, listed, folder / f"{listed}.bddl", states, base)
    check_name(installation, task, name)
    for path in (description_file(installation, suite, listed), states):
        if not path.is_file():
            raise SubstrateError(f"{installation} lacks {str(path)!r}. Restore it from the package.")
    return task


def base_name(name: str) -> str:
    """Name of the task that a task of the registry varies."""
    return _SUFFIX.sub("", name)


def description_file(installation: Installation, suite: str, name: str) -> Path:
    """Return the BDDL file that a task of the registry is made from, which need not exist."""
    return installation.bddl / suite / f"{name.partition('_view_')[0]}.bddl"


def noise_of(built: Built, scene: str) -> Callable[[Image, str, int], Image] | None:
    """Noise that LIBERO-Plus's wrapper puts on the images of this environment; None where it puts none.

    Raises:
        SubstrateError: The noise needs a package that is not installed.
    """
    number = int(getattr(built.wrapper, "noise", 0))
    if number == 0:
        return None
    names = type(built.wrapper).step.__globals__
    kind, level = divmod(number - 1, _LEVELS)
    names["np"] = _OlderNumpy()
    noise = _Noise(names[_NOISES[kind]], level + 1, scene)
    noise(np.zeros((_PROBE_PX, _PROBE_PX, 3), dtype=np.uint8), "agentview", 1)
    return noise


@dataclass(frozen=True)
class _Noise:
    """The wrapper's noise on the agent's view after each step, with a seed of its own.

    The wrapper draws from the global generator, so that two rollouts differ; here the draws are those of
    (scene, steps since reset).
    """

    function: Callable[..., Any]
    level: int
    scene: str

    def __call__(self, image: Image, camera: str, steps: int) -> Image:
        if camera != "agentview" or steps == 0:
            return image  # the wrapper leaves what set_init_state returns as it is
        from PIL import Image as Pictures

        key = hashlib.sha256(f"libero-max-plus-noise|{self.scene}|{steps}".encode()).digest()
        with global_generators_restored():
            np.random.seed(int.from_bytes(key[:4], "little"))  # noqa: NPY002 - the wrapper's generator
            try:
                noisy = self.function(Pictures.fromarray(image), severity=self.level)
            except IndexError as error:
                raise SubstrateError(
                    f"LIBERO-Plus's {self.function.__name__} cannot be applied to an image of "
                    f"{image.shape[0]} px: it needs 224 px at least. Ask for larger images (image_size)."
                ) from error
        result: Image = np.asarray(noisy).astype(np.uint8)
        return result


class _OlderNumpy:
    """NumPy with the two names of version 1 that the wrapper uses."""

    float_ = np.float64
    fromstring = staticmethod(np.frombuffer)

    def __getattr__(self, name: str) -> Any:
        return getattr(np, name)
