"""What lies beside the pairs of a run for people to look at: traces, films and crashes, and their names."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

TRACES_NAME = "traces"
FILMS_NAME = "films"
CRASHES_NAME = "crashes"
"""What processes said that died."""

FILM_FORMATS = ("mp4", "webp")
FILM_SUFFIXES = tuple(f".{kind}" for kind in FILM_FORMATS)

FILM_SELECTIONS = ("regressions", "changed", "all")
"""Which pairs are filmed: those that only Base completes, those whose outcomes differ, all."""

VIEWS = ("world", "saw")
"""What a film shows: the world through its cameras, or what the policy saw at its queries."""

_SEPARATOR = "--"
_SAW = f"{_SEPARATOR}saw"


def film_name(item_id: str, arms: Iterable[str], suffix: str, view: str = "world") -> str:
    """Name of the file of a film: the pair, the arms, and what it shows of them.

    Args:
        item_id: The pair.
        arms: The arms from left to right.
        suffix: One of :data:`FILM_SUFFIXES`.
        view: One of :data:`VIEWS`.
    """
    return f"{item_id}{_SEPARATOR}{'-'.join(arms)}{_SAW if view == 'saw' else ''}{suffix}"


def films_in(folder: Path) -> dict[str, str]:
    """Path of the film of each pair that has one, relative to the folder of the run, by item id.

    Films of what a policy saw are not among them.
    """
    return {
        path.name.rpartition(_SEPARATOR)[0]: f"{FILMS_NAME}/{path.name}"
        for path in _films(folder)
        if not path.stem.endswith(_SAW)
    }


def _films(folder: Path) -> list[Path]:
    found = sorted((folder / FILMS_NAME).glob(f"*{_SEPARATOR}*"))
    return [path for path in found if path.suffix in FILM_SUFFIXES and not path.name.startswith(".")]


def kept_beside(folder: Path) -> list[str]:
    """Names of the folders of traces, films and crashes that a run has filled."""
    traces = [TRACES_NAME] if any((folder / TRACES_NAME).glob("*.npz")) else []
    crashes = [CRASHES_NAME] if any((folder / CRASHES_NAME).glob("*.txt")) else []
    return traces + ([FILMS_NAME] if _films(folder) else []) + crashes
