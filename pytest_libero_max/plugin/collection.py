"""From a manifest to test items: parametrization, markers, and the pseudo path ``libero-max``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import EVENTS, FAMILIES, SUITE_BUDGETS, Case
from pytest_libero_max.benchmark.manifests import Manifest, load_manifest
from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.plugin import options
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.stash_keys import MANIFEST, NOISE_CASES, SETTINGS

PSEUDO_PATH = "libero-max"
"""Stands for the pairs on the command line and begins their node ids, wherever the package is installed."""

PAIRS_FILE = Path(__file__).with_name("pairs.py")
CASE_FIXTURE = "libero_max_case"
ITEM_PREFIX = f"{PSEUDO_PATH}::test_pair["


class PairModule(pytest.Module):
    """The module of the pairs, under a node id that is the same on every machine."""


def settings_of(config: pytest.Config) -> Settings:
    """The settings, resolved once.

    Raises:
        pytest.UsageError: See :func:`pytest_libero_max.plugin.options.resolve`.
    """
    if SETTINGS not in config.stash:
        config.stash[SETTINGS] = options.resolve(config)
    return config.stash[SETTINGS]


def manifest_of(config: pytest.Config) -> Manifest:
    """The track or manifest of the run, whole.

    Raises:
        pytest.UsageError: The track is unknown or the manifest is unusable.
    """
    if MANIFEST not in config.stash:
        from pytest_libero_max.benchmark.tracks import load_track
        from pytest_libero_max.changes import check_changes

        settings = settings_of(config)
        try:
            manifest = load_manifest(settings.manifest) if settings.manifest else load_track(settings.track)
            check_changes(manifest.cases)
        except LiberoMaxError as error:
            raise pytest.UsageError(str(error)) from None
        config.stash[MANIFEST] = manifest
    return config.stash[MANIFEST]


def cases_of(config: pytest.Config) -> tuple[Case, ...]:
    """The cases of the run before ``-k`` and ``-m``, sorted by item id."""
    from pytest_libero_max.benchmark.sampling import stratified

    settings = settings_of(config)
    cases = manifest_of(config).cases
    if settings.limit is not None:
        cases = stratified(cases, settings.limit)
    cases = tuple(sorted(cases, key=lambda case: case.item_id))
    if settings.shard is not None:
        index, count = settings.shard
        # Blocks, not every n-th: neighbours share scenes, which are expensive to build.
        cases = cases[len(cases) * (index - 1) // count : len(cases) * index // count]
    return cases


def noise_cases_of(config: pytest.Config) -> frozenset[str]:
    """Item ids of the cases of the run whose Base is played twice."""
    if NOISE_CASES not in config.stash:
        from pytest_libero_max.benchmark.sampling import stratified

        count = settings_of(config).noise_floor
        chosen = stratified(cases_of(config), count) if count else ()
        config.stash[NOISE_CASES] = frozenset(case.item_id for case in chosen)
    return config.stash[NOISE_CASES]


def aim(config: pytest.Config) -> None:
    """Make the command line mean the pairs where it says so.

    ``libero-max`` and ``libero-max::...`` stand for the pairs; a policy on the command line without any
    path means nothing but the pairs.
    """
    unaimed = config.args_source is not pytest.Config.ArgsSource.ARGS
    if unaimed and options.given_on_command_line(config):
        config.args = [str(PAIRS_FILE)]
        return
    config.args = [_resolve(arg) for arg in config.args]


def _resolve(arg: str) -> str:
    path, separator, rest = arg.partition("::")
    return f"{PAIRS_FILE}{separator}{rest}" if path == PSEUDO_PATH and not Path(path).exists() else arg


def register_markers(config: pytest.Config, cases: tuple[Case, ...] = ()) -> None:
    """Declare the markers that pair items carry, for ``-m`` and ``--strict-markers``."""
    for event in EVENTS:
        config.addinivalue_line("markers", f"{event}: LIBERO-MAX pairs with this event")
    for family in FAMILIES:
        config.addinivalue_line("markers", f"{family}: LIBERO-MAX pairs with an event of this family")
    for suite in SUITE_BUDGETS:
        config.addinivalue_line("markers", f"{suite}: LIBERO-MAX pairs of this suite")
    for variant in (0, 1):
        config.addinivalue_line("markers", f"variant_{variant}: LIBERO-MAX pairs with this parameter variant")
    for source in sorted({case.source for case in cases}):
        config.addinivalue_line("markers", f"source_{source}: LIBERO-MAX pairs from this source")
    for category in sorted({_category_marker(case) for case in cases}):
        config.addinivalue_line("markers", f"{category}: LIBERO-MAX pairs of this source category")


def parametrize(metafunc: pytest.Metafunc) -> None:
    """Give every test that asks for a case one item a case."""
    if CASE_FIXTURE not in metafunc.fixturenames:
        return
    metafunc.parametrize(
        CASE_FIXTURE,
        [pytest.param(case, id=case.item_id, marks=_marks(case)) for case in cases_of(metafunc.config)],
    )


def case_of(item_node_id: str) -> str | None:
    """Item id of the case that a pair's node id names, or None for any other test."""
    if not item_node_id.startswith(ITEM_PREFIX):
        return None
    return item_node_id[len(ITEM_PREFIX) :].split("]", 1)[0]


def _marks(case: Case) -> list[Any]:
    names = (
        case.event.name,
        case.event.family,
        case.suite,
        f"variant_{case.event.variant}",
        f"source_{case.source}",
        _category_marker(case),
    )
    return [getattr(pytest.mark, name) for name in names]


def _category_marker(case: Case) -> str:
    return f"category_{case.source_category.lower().replace(' ', '_')}"
