"""The substrate of Meta-World's tasks, which keeps the worlds that were used last."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.lab.metaworld.robot import MT50
from pytest_libero_max.lab.metaworld.spares import SPARES
from pytest_libero_max.lab.metaworld.tasks import task
from pytest_libero_max.lab.metaworld.world import MetaworldWorld
from pytest_libero_max.substrates.kept_worlds import KeptWorlds
from pytest_libero_max.worlds import threads
from pytest_libero_max.worlds.rendering import context

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case

NAME = MT50.benchmark
WORLDS = 4
"""Number of worlds that a substrate keeps."""

_RESULT_PACKAGES = ("metaworld", "mujoco", "numpy", "scipy", "gymnasium")


def spares_of(case: Case) -> tuple[str, ...]:
    """Return the spare objects that the setup of a case takes out, and so its scene has to have."""
    taken = {change.get("object") for change in case.event.setup}
    return tuple(spare.name for spare in SPARES if spare.name in taken)


class MetaworldSubstrate:
    """Builds the worlds of tasks, with the spare objects that a case needs and no others."""

    name = NAME

    def __init__(self) -> None:
        self._worlds = KeptWorlds[tuple[int, tuple[str, ...]], MetaworldWorld]()

    def world(self, case: Case) -> MetaworldWorld:
        if case.suite != MT50.name:
            raise SubstrateError.seen("suite", case.suite, f", but {NAME} has {MT50.name}.")
        key = case.task_index, spares_of(case)
        kept = self._worlds.used(key)
        if kept is not None:
            return kept
        world = self._worlds[key] = MetaworldWorld(task(case.task_index), key[1])
        self._worlds.shrink(WORLDS)
        return world

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {"substrate": NAME, **self._packages, **context.fingerprint(images), **threads.fingerprint()}

    @cached_property
    def _packages(self) -> Mapping[str, str]:
        return {package: version(package) for package in _RESULT_PACKAGES}

    def close(self) -> None:
        self._worlds.close()
