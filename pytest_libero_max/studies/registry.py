"""The studies by name, from a file, and from the header of a run."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

from msgspec import Struct

from pytest_libero_max.benchmark.programs import BASE, DYNAMIC, parse_program, read_document
from pytest_libero_max.benchmark.structs import Object, Text, checked
from pytest_libero_max.errors import ManifestError, OptionError, ReportError
from pytest_libero_max.registry import Registry
from pytest_libero_max.studies.study import Study

FOLDER = Path(__file__).parent
"""Folder of the studies of this package that are data, a file each."""

FILES = (".json", ".toml")
"""Ends of the names of files that hold a study."""

_NAME = re.compile(r"[a-z][a-z0-9-]*")


class _Document(Struct, frozen=True):
    """What a study is beside its program."""

    name: Text
    title: Text
    arms: tuple[Object, ...]
    track: Text = "smoke"


def spelled_study(document: Any) -> Study:
    """Return the study that a document spells: the keys of a program, ``title`` and ``track``.

    Raises:
        ManifestError: It breaks the format.
    """
    head: _Document = checked(document, _Document, "study", ManifestError)
    for arm in head.arms:
        if arm.get("name") in (BASE, DYNAMIC):
            raise ManifestError(
                f"study.arms spells {arm['name']!r}, but a study plays its arms beside Base and Dynamic of "
                "the case. Leave it out, or lay the arms over the cases with --libero-max-program."
            )
    study = Study()
    study.name, study.title, study.track = head.name.replace("_", "-"), head.title, head.track
    spelled = {key: value for key, value in document.items() if key not in ("title", "track")}
    study.program, study.document = parse_program(spelled, "study"), document
    return study


def find_study(text: str, folder: Path = Path()) -> Study:
    """Return the study that a user names, with its settings behind a colon, or one from a file.

    Raises:
        OptionError: There is no such study or file, or what it says breaks a rule.
    """
    if text.endswith(FILES):
        path = folder / Path(text).expanduser()
        study = read_document(path, "study", spelled_study)
        if study.name in STUDIES:
            raise OptionError(
                f"The study in {path} is called {study.name!r}, as one that is installed. "
                "Give it another name."
            )
        study.source = str(path)
        return study
    name, _, settings = text.partition(":")
    return STUDIES[name](settings or None)


def _from_file(name: str, settings: str | None) -> Study:
    """Return a study of this package that is data."""
    if settings is not None:
        raise OptionError.seen("settings", settings, f", but the study {name} has none.")
    study = read_document(FOLDER / f"{name}.json", "study", spelled_study)
    study.document = None  # its name says it
    return study


def _own() -> Mapping[str, Callable[[], object]]:
    return {path.stem: partial(partial, _from_file, path.stem) for path in sorted(FOLDER.glob("*.json"))}


def _of_package(point: EntryPoint) -> Callable[[str | None], Study]:
    """Return what makes a study with settings, of the class that a package offers."""
    name, kind = point.name, point.load()
    if not (isinstance(kind, type) and issubclass(kind, Study)):
        raise ValueError(f"{kind!r} is not a subclass of pytest_libero_max.Study")
    if not _NAME.fullmatch(name):
        raise ValueError(f"name={name!r}, but must be a word of lower-case letters, digits and hyphens")
    for attribute in ("name", "title", "track"):
        if not isinstance(getattr(kind, attribute, None), str):
            raise ValueError(f"{kind.__name__} lacks {attribute}")
    if kind.name != name:
        raise ValueError(f"name={kind.name!r}, but it is registered as {name!r}; both must be the same")
    return kind.of


def _accept(_: str, make: Any) -> Callable[[str | None], Study]:
    read: Callable[[str | None], Study] = make
    return read


STUDIES: Registry[Callable[[str | None], Study]] = Registry(
    "study", "pytest_libero_max.studies", _own, _accept, OptionError, _of_package
)
"""What makes each study from its settings: this package's, then those that installed packages add."""


def study_from_dict(values: Any) -> Study:
    """Read what :meth:`.study.Study.to_dict` wrote, or raise ReportError."""
    try:
        spelled = values.get("document")
        study = STUDIES[values["name"]](values.get("settings")) if spelled is None else spelled_study(spelled)
        if study.to_dict() != values:
            raise ValueError("it has other fields")
    except (AttributeError, KeyError, TypeError, ValueError, ManifestError, OptionError) as error:
        raise ReportError.seen(
            "study",
            values,
            f" of a run is none that this version knows ({error}). Read it with the version and the "
            "packages that played it.",
        ) from error
    return study
