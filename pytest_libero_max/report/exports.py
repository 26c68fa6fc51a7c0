"""A run in the formats of other tools, each of which a package adds by an entry point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import GateResult
    from pytest_libero_max.runs.store import StoredRun

Export: TypeAlias = "Callable[[StoredRun, Sequence[GateResult]], dict[str, str]]"
"""Returns texts by the path of their file in a folder; by the empty path that of the format's only file."""


def _accept(name: str, module: object) -> Export:
    files: Any = getattr(module, "files", None)
    text: Any = getattr(module, "text", None)
    if callable(files):
        return lambda run, gates: files(run)
    if callable(text):
        return lambda run, gates: {"": text(run, gates)}
    raise ValueError(
        "an entry point of a format is a module with a function text, or files for several files"
    )


EXPORTS: Registry[Export] = Registry("format", "pytest_libero_max.exports", dict, _accept, OptionError)
"""The formats that are installed, by name. Each raises ReportError for a run that it cannot hold."""


def export_files(name: str, run: StoredRun, gates: Sequence[GateResult] = ()) -> dict[str, str]:
    """Return a run in a format.

    Args:
        name: One of :data:`EXPORTS`.
        run: The run; pairs that were not measured are never failures of the policy.
        gates: Verdicts on the run, for formats that have a place for them.

    Returns:
        Texts by the path of their file in a folder; by the empty path that of the format's only file.

    Raises:
        OptionError: There is no such format.
        ReportError: The run has nothing that the format can hold.
    """
    return EXPORTS[name](run, gates)
