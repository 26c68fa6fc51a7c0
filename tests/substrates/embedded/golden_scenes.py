"""Digests of what the embedded scenes consist of, field by field, and the file that keeps them.

After a change that is meant to change scenes, write the file again and read in its diff which fields changed:

    python -m tests.substrates.embedded.golden_scenes

Each line of MuJoCo has a file; those of later lines keep one digest for each scene, without its fields.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue
from pytest_libero_max.substrates.embedded.remodel import Remodel
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate, EmbeddedWorld
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.libero_tasks import SUITES, tasks
from pytest_libero_max.worlds.scene_digest import combined, state_fields
from tests.mujoco_line import LINE

FILE = Path(__file__).with_name("golden_scenes.json" if LINE == "3.3" else f"golden_scenes_{LINE}.json")
DIGITS = 6
"""Digits that are kept of a field's digest. That of the whole scene is kept in full."""

TASKS = tuple(f"{suite}/{row.index}" for suite in SUITES for row in tasks(suite))


@cache
def variations() -> Mapping[str, Variation]:
    """The first source variation of every kind of every category, by its key."""
    first: dict[tuple[str, str, str], Variation] = {}
    for source in ("plus", "pro"):
        for variation in catalogue(source):
            first.setdefault((source, variation.category, variation.kind), variation)
    return {variation.key: variation for variation in first.values()}


def world_of(substrate: EmbeddedSubstrate, name: str) -> EmbeddedWorld:
    """The world of an unmodified task, or of a source variation."""
    if name in TASKS:
        suite, index = name.split("/")
        return substrate._world(suite, int(index), Remodel())
    return substrate.varied_world(variations()[name])


def fields_of(world: EmbeddedWorld) -> dict[str, str]:
    """Digests of the scene and of its first initial state, by field."""
    world.reset(0)
    return {**world.scene_fields(), **state_fields(world.snapshot())}


def versions() -> dict[str, str]:
    """What the digests depend on beside the scenes."""
    packages = {name: version(name) for name in ("mujoco", "robosuite", "numpy")}
    return {**packages, "machine": platform.machine()}


def golden() -> Any:
    """The content of the file."""
    return json.loads(FILE.read_text())


def differing_fields(golden: Any, name: str, fields: Mapping[str, str]) -> list[str]:
    """The fields of a scene whose digests are not those of the file, sorted."""
    place = list(golden["scenes"]).index(name)
    kept = {field: words.split() for field, words in golden["fields"].items()}
    known = {field: words[place if len(words) > 1 else 0] for field, words in kept.items()}
    now = {field: digest[:DIGITS] for field, digest in fields.items()}
    return sorted(field for field in {*known, *now} if known.get(field, _NONE) != now.get(field, _NONE))


_NONE = "-" * DIGITS


def _content() -> Any:
    substrate = EmbeddedSubstrate()
    found = {name: fields_of(world_of(substrate, name)) for name in (*TASKS, *variations())}
    substrate.close()
    names = sorted({field for fields in found.values() for field in fields}) if LINE == "3.3" else []
    return {
        "versions": versions(),
        "scenes": {name: combined(fields) for name, fields in found.items()},
        "fields": {
            field: " ".join(_once(fields.get(field, _NONE)[:DIGITS] for fields in found.values()))
            for field in names
        },
    }


def _once(digests: Iterable[str]) -> Iterator[str]:
    """Digests in the order of the scenes, or a single one where all are equal."""
    words = list(digests)
    return iter(words[:1] if len(set(words)) == 1 else words)


if __name__ == "__main__":
    FILE.write_text(json.dumps(_content(), indent=1) + "\n")
    print(f"Wrote {FILE}.")
