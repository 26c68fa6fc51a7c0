"""A run in the formats of other tools, each of which a package adds by an entry point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import GateResult
    from pytest_libero_max.runs.store import StoredRun


@dataclass(frozen=True)
class ExportedRun:
    """A run that is written in a format."""

    folder: Path
    """Its folder, with reports and films beside the pairs."""
    stored: StoredRun
    """Its pairs; those that were not measured are never failures of the policy."""
    gates: Sequence[GateResult] = ()
    """Verdicts on the run, for formats that have a place for them."""
    step: int = 0
    """Step of the training after which it was played, for formats with an axis of steps."""


Export: TypeAlias = "Callable[[ExportedRun, Path], list[Path]]"
"""Writes a run into a file, or a folder where it has several, and returns the paths of what it wrote.

Raises ReportError where the run has nothing that it can hold, or a file cannot be written.
"""


def _accept(name: str, module: object) -> Export:
    write: Any = getattr(module, "write", None)
    files: Any = getattr(module, "files", None)
    text: Any = getattr(module, "text", None)
    if callable(write):
        return lambda run, place: write(run, place)
    if callable(files):
        return lambda run, place: _write_texts(files(run.stored), place)
    if callable(text):
        return lambda run, place: _write_texts({"": text(run.stored, run.gates)}, place)
    raise ValueError(
        "an entry point of a format is a module with a function text, files for several files, or write for "
        "what is no text"
    )


EXPORTS: Registry[Export] = Registry("format", "pytest_libero_max.exports", dict, _accept, OptionError)
"""The formats that are installed, by name."""


def _write_texts(texts: dict[str, str], place: Path) -> list[Path]:
    from pytest_libero_max.report.writers.report_files import make_folder, write_text

    for name, text in texts.items():
        if name:
            make_folder((place / name).parent)
        write_text(place / name, text)
    return [place / name for name in texts]
