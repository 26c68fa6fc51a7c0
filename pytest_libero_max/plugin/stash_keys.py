"""Keys of the plugin's state on pytest's objects."""

from __future__ import annotations

from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.plugin.options import Settings

SETTINGS = pytest.StashKey[Settings]()
"""On the config, where the plugin is in use."""

MANIFEST = pytest.StashKey[Manifest]()
"""On the config: the track or manifest of the run."""

CASES = pytest.StashKey[tuple[Case, ...]]()
"""On the config: the cases of the run before ``-k`` and ``-m``."""

NOISE_CASES = pytest.StashKey[frozenset[str]]()
"""On the config: the item ids whose Base is played twice."""

DECLARED = pytest.StashKey[tuple[object, object]]()
"""On the config: the policy that was played last, and a copy of its spec from before its first pair."""

LOADED = pytest.StashKey[Any]()
"""On the config: the policy that our fixture has loaded."""

RESULT = pytest.StashKey[Json]()
"""On an item: its pair record or pair error, as JSON types."""

ADAPTER_DIGEST = pytest.StashKey[str]()
"""On the config of a process that plays: the digest of the adapter's code, once the policy can be played."""

POLICY_PHASE = "policy"
"""Phase of a pair error that every other pair would end with as well: the policy cannot be played at all."""

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
