"""Readers of results that another runner wrote: outcomes of known cases, without records.

A reader is one class, under its name in the entry-point group ``pytest_libero_max.readers``. What it reads
has a report, a page and gates, as far as outcomes alone give them, and says what it lacks.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PAIRS_NAME


@dataclass(frozen=True)
class PairOutcome:
    """What another runner says of a case."""

    base: bool
    """True if Base completed the task."""
    dynamic: bool
    triggered: bool
    """True if the event happened."""
    responded: bool
    """True if a query followed it."""
    stale: int | None = None
    """Stale actions until that query; None where it is not known."""


@dataclass(frozen=True)
class ReadResults:
    """Results of another runner."""

    planned: tuple[PlannedPair, ...]
    """The cases that it was to play."""
    outcomes: Mapping[str, PairOutcome]
    """By case id; cases without a result are left out."""
    provenance: Json
    """Origin, with the parts of a run's (:class:`~pytest_libero_max.runs.plan.Provenance`)."""
    notes: tuple[str, ...]
    """What they lack, and what else has to be known before any number, as sentences."""


class ResultsReader(ABC):
    """Reads the results of one runner."""

    name: ClassVar[str]

    @abstractmethod
    def recognises(self, folder: Path) -> bool:
        """Return True if a folder holds results of this runner; reads no more than names of files."""

    @abstractmethod
    def read(self, folder: Path, cases: str | None) -> ReadResults:
        """Read the results.

        Args:
            folder: The folder.
            cases: Track or path of the manifest that was played; None to find it by the ids of its cases.

        Raises:
            ReportError: The results are damaged, or contradict the cases.
            OptionError: No cases are known for them.
        """


def _accept(_: str, kind: object) -> ResultsReader:
    if not (isinstance(kind, type) and issubclass(kind, ResultsReader)) or inspect.isabstract(kind):
        raise ValueError(f"{kind!r} is not a subclass of ResultsReader with recognises() and read()")
    return kind()


READERS: Registry[ResultsReader] = Registry(
    "reader", "pytest_libero_max.readers", dict, _accept, OptionError, attribute="name"
)
"""The readers by name, which installed packages add."""


def reader_of(folder: Path) -> ResultsReader | None:
    """Return the reader of a folder of results; None for a run of this package, and where nobody knows it."""
    if not folder.is_dir() or any((folder / name).exists() for name in (PAIRS_NAME, PACKED_PAIRS_NAME)):
        return None
    return next((reader for reader in READERS.values() if reader.recognises(folder)), None)
