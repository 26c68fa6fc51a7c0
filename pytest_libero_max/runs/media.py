"""Folders beside the pairs of a run, for people to look at: traces, films and crash logs."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import PairRecord

TRACES_NAME = "traces"
FILMS_NAME = "films"
RERUN_NAME = "rerun"
CRASHES_NAME = "crashes"
"""Folder of the crash logs of processes that died."""
PICTURES_NAME = "pictures"
"""Folder for the pictures of ``libero-max list cases CASE --pictures``, from which pages take them."""

FILM_FORMATS = ("mp4", "webp")
FILM_SUFFIXES = tuple(f".{kind}" for kind in FILM_FORMATS)

FILM_SELECTIONS = ("regressions", "changed", "all")
"""Selections of pairs to film: those that only Base completes, those whose outcomes differ, all."""

SELECTIONS = ("none", *FILM_SELECTIONS)
"""Pairs that a run films, or whose traces it keeps."""

MOST_FILMS = 20
"""Number of regressions, and of gains, that a run films unless another is asked for: those it names."""

VIEWS = ("world", "policy")
"""Views of a film: the world through its cameras, or the policy's images at its queries."""

_SEPARATOR = "--"
_POLICY = f"{_SEPARATOR}policy"


class _Compared(Protocol):
    """What is asked of a pair."""

    @property
    def outcome(self) -> str:
        """Name of its outcome."""
        ...


_LONGEST_ARMS = 120
"""Most characters of the arms in the name of a film."""

_MANY_ARMS = "_arms"
"""Ends the number that stands there for more."""


def selection_named(text: str) -> str:
    """Return the name of a selection; ``regression`` is another spelling of ``regressions``."""
    return "regressions" if text == "regression" else text


def is_selected(pair: _Compared, which: str) -> bool:
    """Return True if a pair belongs to one of :data:`SELECTIONS`."""
    changed = ("regression", "change_associated_success")
    members = {"none": (), "regressions": changed[:1], "changed": changed}
    return which == "all" or pair.outcome in members[which]


def distinct_arms(record: PairRecord) -> tuple[str, ...]:
    """Return the arms of a pair that differ from those before them, in the order of the record."""
    proofs: dict[str | None, str] = {}
    for name, arm in record.arms.items():
        if arm.shares is None:
            proofs.setdefault(arm.proof, name)
    return tuple(proofs.values())


def film_name(item_id: str, arms: Iterable[str], suffix: str, view: str = "world") -> str:
    """Return the name of a film's file: the pair, the arms, and the view.

    Of many arms it has the number, because a file system takes names of 255 bytes at most.
    """
    names = [*arms]
    text = "-".join(names)
    shown = text if len(text) <= _LONGEST_ARMS else f"{len(names)}{_MANY_ARMS}"
    return f"{item_id}{_SEPARATOR}{shown}{_POLICY if view == 'policy' else ''}{suffix}"


def films_in(folder: Path, view: str = "world") -> dict[str, str]:
    """Path of the film of each pair that has one, relative to the folder of the run, by item id."""
    found = {}
    for path in _films(folder):
        of_policy = path.stem.endswith(_POLICY)
        if of_policy == (view == "policy"):
            name = path.stem.removesuffix(_POLICY) if of_policy else path.stem
            found[name.rpartition(_SEPARATOR)[0]] = f"{FILMS_NAME}/{path.name}"
    return found


def traced_in(folder: Path) -> set[str]:
    """Item ids of the pairs of which a run has kept traces, from which films are made later."""
    return {path.stem for path in (folder / TRACES_NAME).glob("*.npz")}


def show_command(folder: Path, name: str, item_ids: Iterable[str], provenance: Json) -> str | None:
    """Return the command that shows pairs of a run; None where the run has kept nothing to show of them."""
    asked, view = {*item_ids}, ["libero-max", "view", name]
    if asked & films_in(folder).keys():
        return shlex.join(view)
    if not asked & traced_in(folder):
        return None
    manifest = provenance["case_set"].get("path")  # which nothing but an option may name
    return shlex.join(view if manifest is None else [*view, f"--cases={manifest}"])


def _films(folder: Path) -> list[Path]:
    found = sorted((folder / FILMS_NAME).glob(f"*{_SEPARATOR}*"))
    return [path for path in found if path.suffix in FILM_SUFFIXES and not path.name.startswith(".")]


def caption_of(path: str, item_id: str) -> str:
    """Return the title of a film or picture from its file name: ``base-dynamic, what the policy saw``."""
    name = path.rpartition("/")[2].rpartition(".")[0].removeprefix(f"{item_id}{_SEPARATOR}")
    return f"{name.removesuffix(_POLICY)}, what the policy saw" if name.endswith(_POLICY) else name


def filmed_arms(path: str, record: PairRecord) -> tuple[str, ...]:
    """Return the arms of a film from left to right, from its file name; of many arms, those of the pair."""
    names = tuple(caption_of(path, record.item_id).split("-"))
    return distinct_arms(record) if names[0].endswith(_MANY_ARMS) else names


def pictures_in(folder: Path) -> dict[str, list[str]]:
    """Paths of the pictures of each pair that has some, relative to the folder of the run, by item id."""
    found: dict[str, list[str]] = {}
    for path in sorted((folder / PICTURES_NAME).glob(f"*{_SEPARATOR}*.png"), key=_camera_then_when):
        found.setdefault(path.name.rpartition(_SEPARATOR)[0], []).append(f"{PICTURES_NAME}/{path.name}")
    return found


def _camera_then_when(path: Path) -> tuple[str, bool]:
    """Sort key: by camera, then ``before`` before ``after``."""
    begin, _, when = path.stem.rpartition("-")
    return begin, when != "before"


def kept_beside(folder: Path) -> list[str]:
    """Names of the folders of traces, films, recordings and crashes that a run has filled."""
    traces = [TRACES_NAME] if any((folder / TRACES_NAME).glob("*.npz")) else []
    crashes = [CRASHES_NAME] if any((folder / CRASHES_NAME).glob("*.txt")) else []
    recordings = [RERUN_NAME] if any((folder / RERUN_NAME).glob("*.rrd")) else []
    return traces + ([FILMS_NAME] if _films(folder) else []) + recordings + crashes
