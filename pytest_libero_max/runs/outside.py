"""What a folder of results names outside of itself: it is shown, and never opened, imported or run.

A published folder is written by somebody else. Installations, manifests, profiles and adapters come from the
options of the machine that reads it.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.programs import program_of_run
from pytest_libero_max.benchmark.tracks import load_cases, load_track
from pytest_libero_max.errors import ManifestError, OptionError, ReportError
from pytest_libero_max.policies.references import shipped_names
from pytest_libero_max.runs.comparability import places


def outside_text(provenance: Json) -> str | None:
    """Return a sentence on the places that a run names and that are not opened; None where it names none."""
    named = [f"{place}={shlex.quote(path)}" for place in places() for path in _paths(provenance, place)]
    if not named:
        return None
    return (
        f"The folder names {', '.join(named)}. Nothing that a folder names is opened; the options of this "
        "command say what is used."
    )


def _paths(provenance: Json, place: str) -> list[str]:
    """Return the paths at a place of the provenance; what has no folder and no ending is a name of ours."""
    part, _, field = place.partition(".")
    value: Any = provenance[part].get(field) or ()
    values = [value] if isinstance(value, str) else value if isinstance(value, list) else [value]
    return [text for text in map(str, values) if "/" in text or "\\" in text or Path(text).suffix]


def built_in_policy(provenance: Json) -> str | None:
    """Return the name of the built-in policy that a run played; None for a policy of somebody else."""
    reference = str(provenance["policy"]["reference"])
    return reference if reference in shipped_names() else None


def cases_of_run(provenance: Json, asked: str | None, option: str = "--cases") -> Manifest:
    """Return the cases of a run: those of a frozen track by its name, otherwise those that a user names.

    Args:
        asked: Track or path of a manifest, as the user names it; None: the track of the run.

    Raises:
        OptionError: The run played a manifest, and none is named, or there is no such track.
        ManifestError: The cases cannot be read.
    """
    kind, _, name = str(provenance["case_set"]["name"]).partition(" ")
    if asked is None and kind != "track":
        path = provenance["case_set"].get("path", name)
        raise OptionError(
            f"The run played the cases of {kind} {str(path)!r}. Nothing that a folder names is opened: give "
            f"the manifest with {option}={shlex.quote(str(path))}."
        )
    try:
        manifest = load_track(name) if asked is None else load_cases(str(Path(asked).expanduser()))
        program = program_of_run(provenance["protocol"])
    except ManifestError as error:
        raise ManifestError(f"{error} Name the track or manifest of the run with {option}.") from error
    return manifest if program is None else manifest.playing(program)


def require_inside(folder: Path, path: Path) -> Path:
    """Return a path in a folder of results that leads to nothing outside of it, or raise ReportError."""
    if not path.resolve().is_relative_to(folder.resolve()):
        raise ReportError(
            f"{path} leads out of {folder}, to {path.resolve()}. Nothing outside a folder of results is read "
            "or written for it: replace the link by what it leads to."
        )
    return path
