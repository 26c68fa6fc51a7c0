"""What lies beside the pairs of a run for people to look at: traces and films, and how they are called."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

TRACES_NAME = "traces"
FILMS_NAME = "films"

FILM_FORMATS = ("mp4", "webp")
FILM_SUFFIXES = tuple(f".{kind}" for kind in FILM_FORMATS)

FILM_SELECTIONS = ("regressions", "changed", "all")
"""Which pairs are filmed: those that only Base completes, those whose outcomes differ, all."""

_SEPARATOR = "--"


def film_name(item_id: str, arms: Iterable[str], suffix: str) -> str:
    """Name of the file of a film: the pair and the arms that it shows.

    Args:
        item_id: The pair.
        arms: The arms from left to right.
        suffix: One of :data:`FILM_SUFFIXES`.
    """
    return f"{item_id}{_SEPARATOR}{'-'.join(arms)}{suffix}"


def films_in(folder: Path) -> dict[str, str]:
    """Path of the film of each pair that has one, relative to the folder of the run, by item id."""
    found = sorted(path.name for path in (folder / FILMS_NAME).glob(f"*{_SEPARATOR}*"))
    return {
        name.rpartition(_SEPARATOR)[0]: f"{FILMS_NAME}/{name}"
        for name in found
        if name.endswith(FILM_SUFFIXES) and not name.startswith(".")
    }


def kept_beside(folder: Path) -> list[str]:
    """Names of the folders of traces and films that a run has filled."""
    traces = [TRACES_NAME] if any((folder / TRACES_NAME).glob("*.npz")) else []
    return traces + ([FILMS_NAME] if films_in(folder) else [])
