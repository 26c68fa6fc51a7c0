"""A run in the formats of other tools: a module for each, with a function ``text``."""

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


def export_text(name: str, run: StoredRun, gates: Sequence[GateResult] = ()) -> str:
    """Return a run in a format.

    Args:
        name: One of :func:`format_names`.
        run: The run; pairs that were not measured are never failures of the policy.
        gates: Verdicts on the run, for formats that have a place for them.

    Raises:
        OptionError: There is no such format.
    """
    if name not in format_names():
        raise OptionError.seen(
            "format", name, f", which is not a format. {did_you_mean(name, format_names())}"
        )
    module = importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
    text: str = module.text(run, gates)
    return text
