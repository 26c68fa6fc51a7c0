"""The tasks of LIBERO: instructions, places of things, and the goal, read from ``libero_tasks.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.errors import SubstrateError, did_you_mean
from pytest_libero_max.worlds.privileged import Fact

Arena = Literal["tabletop", "floor", "kitchen", "living_room", "study"]
"""The rooms that LIBERO's scenes are in."""

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Place:
    """A rectangle of the table or floor in which something is put at reset."""

    name: str
    """As in LIBERO, for example ``main_table_plate_region``."""
    surface: str
    """For example ``main_table`` or ``floor``."""
    box: Box
    """(x_min, y_min, x_max, y_max) in m, world."""
    yaw: float = 0.0
    """Turn about z of a fixture that is put here, rad."""


@dataclass(frozen=True)
class Task:
    """One task."""

    suite: str
    index: int
    """Position in the benchmark's own order."""
    language: str
    """The instruction that the benchmark gives to a policy."""
    arena: Arena
    objects: tuple[str, ...]
    """Instances that move freely, in the order of their joints."""
    fixtures: tuple[str, ...]
    """Instances that are bolted down, in the order of their joints."""
    places: Mapping[str, Place]
    """Rectangles by name."""
    start: tuple[Fact, ...]
    """Facts that hold at reset."""
    goal: tuple[Fact, ...]
    """Facts that must all hold at the end."""
    scene: str = ""
    """LIBERO-90's name of the scene, with which the names of LIBERO-10's files begin."""

    @property
    def name(self) -> str:
        """The stem of its BDDL file."""
        words = self.language.replace(" ", "_")
        return f"{self.scene}_{words}" if self.scene else words


def category_of(instance: str) -> str:
    """``akita_black_bowl`` for ``akita_black_bowl_1``."""
    return instance.rpartition("_")[0]


@cache
def _tables() -> dict[str, Any]:
    return tomllib.loads(read_text(Path(__file__).with_name("libero_tasks.toml")))


SUITES = tuple(name for name in _tables() if name != "scenes")
"""The suites in the order of every table."""


def _read(suite: str, index: int) -> Task:
    own = _tables()[suite][index]
    scene: dict[str, Any] = _tables()["scenes"][own["scene"]]
    places = {**own.get("places", {}), **scene["places"]}
    return Task(
        suite,
        index,
        own["language"],
        scene["arena"],
        tuple(own.get("objects", scene.get("objects", ()))),
        tuple(scene.get("fixtures", ())),
        MappingProxyType({name: _place(name, scene["surface"], numbers) for name, numbers in places.items()}),
        tuple(Fact(*words) for words in (*scene.get("start", ()), *own.get("start", ()))),
        tuple(Fact(*words) for words in own["goal"]),
        own["scene"] if suite == "libero_10" else "",
    )


def _place(name: str, surface: str, numbers: list[float]) -> Place:
    x_min, y_min, x_max, y_max, *yaw = numbers
    return Place(name, surface, (x_min, y_min, x_max, y_max), *yaw)


@cache
def task(suite: str, index: int) -> Task:
    """Return a task by suite and benchmark index, or raise SubstrateError."""
    if suite not in SUITES:
        raise SubstrateError(
            f"suite={suite!r} is not one of those whose tasks are known here. {did_you_mean(suite, SUITES)}"
        )
    count = len(_tables()[suite])
    if not 0 <= index < count:
        raise SubstrateError(f"index={index!r} is not a task of {suite}: it has the tasks 0 to {count - 1}.")
    return _read(suite, index)


def tasks(suite: str) -> tuple[Task, ...]:
    """Every task of a suite, in the benchmark's order."""
    count = len(_tables()[suite]) if suite in SUITES else 1
    return tuple(task(suite, index) for index in range(count))
