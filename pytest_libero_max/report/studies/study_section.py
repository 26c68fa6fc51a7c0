"""The contract of the part of a report about a study whose arms are compared by rules of its own.

Other studies need none: their arms are reported by event and as settings. An entry point of the group
``pytest_libero_max.study_sections`` has the name of the study.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from pytest_libero_max.errors import OptionError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.registry import Registry
from pytest_libero_max.report.document import Table
from pytest_libero_max.report.plots import Drawable
from pytest_libero_max.report.studies.study_document import Study as StudyResults
from pytest_libero_max.stats.blocks import Block
from pytest_libero_max.studies.study import Study


class StudySection(ABC):
    """What a report holds and shows of a study. It stores ``results``; everything else is made from them."""

    @abstractmethod
    def results(self, study: Study, records: Sequence[PairRecord], tasks: Sequence[str]) -> Block:
        """Compute what ``report.json`` stores.

        Args:
            study: The study.
            records: Measured cases.
            tasks: The reference task of each.

        Raises:
            ReportError: A record lacks an arm of the study.
        """

    @abstractmethod
    def tables(self, study: StudyResults) -> Sequence[Table]:
        """Return the tables, in the order in which they are read."""

    def notes(self, study: StudyResults) -> Sequence[str]:
        """Return notes on the whole study; none by default."""
        return ()

    def plots(self, study: StudyResults) -> Mapping[str, Drawable | str]:
        """Return plots and SVG documents by the stem of their file name; none by default."""
        return {}


def _accept(_: str, kind: object) -> StudySection:
    if not (isinstance(kind, type) and issubclass(kind, StudySection)) or inspect.isabstract(kind):
        raise ValueError(f"{kind!r} is not a subclass of StudySection with results() and tables()")
    return kind()


STUDY_SECTIONS: Registry[StudySection] = Registry(
    "study section", "pytest_libero_max.study_sections", dict, _accept, OptionError
)
"""The sections that installed packages add, by the name of their study."""


def section_of(study: StudyResults) -> StudySection | None:
    """Return the section that the results of a study are from; None where they are of the usual form."""
    return None if study.camera is None else STUDY_SECTIONS[study.name]
