"""Sources of cases that the installations on this machine play, found from their files alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.substrates.libero.installation import (
    ASSETS_INSTALL,
    INSTALL,
    PLUS_INSTALL,
    Installation,
)
from pytest_libero_max.substrates.libero.lacking import (
    PLUS_NAMES,
    PlusNeeds,
    first_of,
    plus_category,
    pro_lacks,
)
from pytest_libero_max.substrates.libero.pro_config import SECTIONS
from pytest_libero_max.substrates.libero.tasks import task_names, task_of
from pytest_libero_max.tasks.suites import LIBERO, LIBERO_SUITES

_TASKS = tuple((suite.name, index) for suite in LIBERO for index in range(suite.tasks))


@dataclass(frozen=True)
class Coverage:
    """Share of a source that plays here."""

    source: str
    """The source, with the category for LIBERO-PRO and LIBERO-Plus."""
    playable: int
    """Its tasks that have all they need."""
    total: int
    """Its tasks; 0 where only its installation could tell."""
    missing: str = ""
    """Files or packages that the others lack, and their source; empty if nothing is missing."""

    def __str__(self) -> str:
        tasks = f"{self.playable} of {counted(self.total, 'task')} play" if self.total else "does not play"
        return f"{self.source}: {tasks}{f'. {self.missing}' if self.missing else ''}"


def coverage(installations: Sequence[Installation]) -> Iterator[Coverage]:
    """LIBERO, the ten categories of LIBERO-PRO, and the seven of LIBERO-Plus.

    Args:
        installations: Installations to play from; may be empty.
    """
    pro = first_of(installations, "pro")
    yield _libero(first_of(installations, "libero"))
    yield from (_pro(pro, category) for category in SECTIONS)
    yield from _plus(first_of(installations, "plus"))


def _libero(installation: Installation | None) -> Coverage:
    if installation is None:
        return Coverage("LIBERO", 0, len(_TASKS), f"Install it: `{INSTALL}` and `{ASSETS_INSTALL}`")
    return _of("LIBERO", [_lacks(installation, suite, index) for suite, index in _TASKS])


def _pro(installation: Installation | None, category: str) -> Coverage:
    source = f"LIBERO-PRO {category}"
    if installation is None:
        return Coverage(source, 0, len(_TASKS), f"Install LIBERO-PRO, with its models as above: `{INSTALL}`")
    return _of(
        source,
        [
            _lacks(installation, suite, index) or pro_lacks(installation, category, suite, index)
            for suite, index in _TASKS
        ],
    )


def _lacks(installation: Installation, suite: str, index: int) -> str:
    try:
        task_of(installation, suite, index)
    except SubstrateError:
        return "Restore its files"
    return ""


def _of(source: str, lacks: Sequence[str]) -> Coverage:
    """Return the coverage by what each task of a source lacks; empty for nothing."""
    return Coverage(source, lacks.count(""), len(lacks), next(filter(None, lacks), ""))


def _plus(installation: Installation | None) -> Iterator[Coverage]:
    if installation is None:
        for category, _ in PLUS_NAMES:
            yield Coverage(f"LIBERO-Plus {category}", 0, 0, f"Install LIBERO-Plus: `{PLUS_INSTALL}`")
        return
    needs = PlusNeeds.of(installation)
    lacks: dict[str, list[str]] = {category: [] for category, _ in PLUS_NAMES}
    for name in (name for suite in LIBERO_SUITES for name in task_names(installation, suite)):
        if (known := plus_category(name)) is not None:
            lacks[known].append(needs.lacking(name))
    for kind, each in lacks.items():
        yield _of(f"LIBERO-Plus {kind}", each)
