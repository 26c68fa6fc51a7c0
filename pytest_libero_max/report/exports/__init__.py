"""A run in the formats of other tools: a module for each, with a function ``text``, or ``files``."""

from __future__ import annotations

import importlib
from collections.abc import Sequence

from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.registry import modules_in
from pytest_libero_max.report.gates import GateResult
from pytest_libero_max.runs.store import StoredRun


def format_names() -> tuple[str, ...]:
    """Return the names of the formats: those of the modules here, with hyphens."""
    return tuple(name.replace("_", "-") for name in modules_in(__name__))


def export_files(name: str, run: StoredRun, gates: Sequence[GateResult] = ()) -> dict[str, str]:
    """Return a run in a format.

    Args:
        name: One of :func:`format_names`.
        run: The run; pairs that were not measured are never failures of the policy.
        gates: Verdicts on the run, for formats that have a place for them.

    Returns:
        Texts by the path of their file in a folder; by the empty path that of the format's only file.

    Raises:
        OptionError: There is no such format.
        ReportError: The run has nothing that the format can hold.
    """
    if name not in format_names():
        raise OptionError.seen(
            "format", name, f", which is not a format. {did_you_mean(name, format_names())}"
        )
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    if hasattr(module, "files"):
        files: dict[str, str] = module.files(run)
        return files
    return {"": module.text(run, gates)}
