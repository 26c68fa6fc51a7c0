"""Hooks that this plugin calls. Each is a recipe: put the function into a ``conftest.py``.

They are called in the process that owns the run: with ``pytest -n`` that is the controller, not a worker. A
hook takes any of the arguments named here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import class_name, text_of
from pytest_libero_max.pairing.record import PairError, PairRecord


def pytest_libero_max_pair_stored(pair: PairRecord | PairError, config: pytest.Config) -> None:
    """Follow the run: called after a pair has been written to ``pairs.jsonl``, in order of arrival.

    To follow a long run from elsewhere, put this in ``conftest.py``::

        def pytest_libero_max_pair_stored(pair):
            with open("/tmp/progress.txt", "a") as file:
                print(pair.item_id, getattr(pair, "outcome", "invalid"), file=file)

    Args:
        pair: The measured pair, or its error. Altering it does not alter the results.
        config: pytest's config.
    """


def pytest_libero_max_report(report: Json, config: pytest.Config) -> None:
    """Add to the report of the run: called before it is written. Gates and exit status are decided before.

    To add a section of your own to ``report.json``, ``report.md`` and ``report.html``, put this in
    ``conftest.py``::

        def pytest_libero_max_report(report):
            report["sections"]["Checkpoint"] = {"step": 30000, "trained on": "libero_goal"}

    A section is a title of your own with a table of names and values. Nothing else may change: every other
    number of a report can be computed again from ``pairs.jsonl`` alone. For the same reason
    ``libero-max report``, which does so, writes a report without your sections.

    Args:
        report: The report as it will be written.
        config: pytest's config.
    """


def pytest_libero_max_reported(
    report: Json, numbers: dict[str, float], folder: Path, config: pytest.Config
) -> None:
    """Send results elsewhere: called after the reports are written.

    To send results elsewhere, put this in ``conftest.py``, or into an installed plugin of pytest::

        def pytest_libero_max_reported(numbers, folder):
            mlflow.log_metrics(numbers)
            mlflow.log_artifacts(folder)

    ``fixtures/hooks`` has two that are maintained, for Weights & Biases and for Trackio.

    Args:
        report: The report as it was written.
        numbers: Its main numbers by name, for example ``dynamic_success``, ``paired_change_lower`` and
            ``events/camera_shift/dynamic_success``. There are no rates and changes of a run that is
            incomplete.
        folder: The output folder, with pairs, reports, traces and films.
        config: pytest's config.
    """


def call_user_hook(
    hook: Callable[..., object], *, may_raise: tuple[type[BaseException], ...] = (), **arguments: Any
) -> str | None:
    """Call a hook; ``SystemExit`` in it is an exception like others, so that gates decide the status.

    Args:
        may_raise: Exceptions that are left to the caller, beside a keyboard interrupt.

    Returns:
        The exception that it raised, in words; None if it raised none.
    """
    passed_on: tuple[type[BaseException], ...] = (KeyboardInterrupt, *may_raise)
    try:
        hook(**arguments)
    except passed_on:
        raise
    except BaseException as error:  # a user's hook may raise anything, and must not cost the run
        return f"{class_name(error)}: {text_of(error)}"
    return None
