from __future__ import annotations

import gc
import os
from functools import cache
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]


def pytest_pycollect_makemodule() -> None:
    """Prepare with the first test module: whoever plays pairs in a clone loads this file alone."""
    _prepare()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what ``pytest -m quick`` runs."""
    from tests.quick import slow_functions

    here, slow = str(Path(__file__).parent) + os.sep, slow_functions()
    for item in items:
        name = f"{item.location[0]}::{getattr(item, 'originalname', '')}"
        if str(item.path).startswith(here) and name not in slow:
            item.add_marker("quick")


def pytest_collection_finish() -> None:
    """Leave what thousands of tests are made of out of each collection of garbage."""
    if _prepare.cache_info().currsize:
        gc.freeze()


@cache
def _prepare() -> None:
    from hypothesis import HealthCheck, settings

    from pytest_libero_max.worlds.threads import use_one_blas_thread
    from tests.warm_processes import use_server

    use_one_blas_thread()  # as in every run: the last bits of an episode depend on the number of threads
    use_server()

    # A test fails for what it says, not because the machine was busy: no limit on the time of an example.
    settings.register_profile(
        "untimed",
        deadline=None,
        max_examples=int(os.environ.get("LIBERO_MAX_TEST_EXAMPLES", "40")),
        suppress_health_check=[HealthCheck.too_slow],
    )
    settings.load_profile("untimed")
