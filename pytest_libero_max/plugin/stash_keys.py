"""Keys of the plugin's state on pytest's objects."""

from __future__ import annotations

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.evaluation.run_cases import RunCases
from pytest_libero_max.evaluation.settings import Settings

SETTINGS = pytest.StashKey[Settings]()
"""On the config, where the plugin is in use."""

CASES = pytest.StashKey[RunCases]()
"""On the config: the cases of the run before ``-k`` and ``-m``."""

LOADED = pytest.StashKey[object]()
"""On the config: the policy that our fixture has loaded."""

RESULT = pytest.StashKey[Json]()
"""On an item: its pair record or pair error, as JSON types."""

RESULT_ATTRIBUTE = "libero_max"
"""The attribute of a test report that carries the same to the controller."""

STATUS_ATTRIBUTE = "libero_max_status"
"""The attribute of a test report that keeps what the terminal shows of its pair."""

STOP = pytest.StashKey[str]()
"""On an item: reason to stop the run, found by the process that played the pair."""

STOP_ATTRIBUTE = "libero_max_stop"
"""The attribute of a test report that carries the same to the controller."""

NOTE = pytest.StashKey[str]()
"""On an item: failures beside its pair, which is measured all the same."""

NOTE_ATTRIBUTE = "libero_max_note"
"""The attribute of a test report that carries the same to the controller."""

DIST_NOTE = pytest.StashKey[str]()
"""On the controller's config: line of the header on a way to hand out tests that cannot be that of pairs."""

END_STATUS = pytest.StashKey[int]()
"""On the config of the process that owns the run: its exit status, decided before users' hooks are called."""

SETTLED = pytest.StashKey[tuple[str, ...]]()
"""On the controller's config: item ids of the pairs of a resumed run that are not played again."""

RUN_BEGUN = pytest.StashKey[float]()
"""On the controller's config: when the run began, before it was resumed, in seconds since 1970."""

RUN_BEGUN_INPUT = "libero_max_run_begun"
"""Key of the same in a worker's input."""

SETTLED_INPUT = "libero_max_settled"
"""Key of the same in a worker's input."""
