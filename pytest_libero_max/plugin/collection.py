"""From a manifest to test items: parametrization, markers, and the pseudo path ``libero-max``."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import counted, did_you_mean
from pytest_libero_max.evaluation.run_cases import RunCases, category_marker, markers_of
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.events.kind import VARIANTS
from pytest_libero_max.events.registry import (
    BENCHMARK_EVENTS,
    BENCHMARK_FAMILIES,
    EVENTS,
    families,
    family_of,
)
from pytest_libero_max.plugin import options
from pytest_libero_max.plugin.options import usage_errors
from pytest_libero_max.plugin.stash_keys import (
    CASES,
    SETTINGS,
    SETTLED,
    SETTLED_INPUT,
)

PSEUDO_PATH = "libero-max"
"""Pseudo path of the pairs on the command line, and the beginning of their node ids."""

PAIRS_FILE = Path(__file__).with_name("pairs.py")
CASE_FIXTURE = "libero_max_case"
_LISTING = ("collectonly", "showfixtures", "show_fixtures_per_test", "setuponly", "setupplan", "cacheshow")
"""pytest's options, by their names in ``config.option``, with which no test is played to its end."""

_LISTED_NODES = 3
"""Number of node ids that the selection names; more are counted."""

TEST_NAME = "test_pair"
ITEM_PREFIX = f"{PSEUDO_PATH}::{TEST_NAME}["


class PairItem(pytest.Function):
    """Test of a pair. Its node id is that of its case, whatever others do to names and parameters."""

    @property
    def case(self) -> Case:
        """Case of the pair."""
        case = self.callspec.params[CASE_FIXTURE]
        assert isinstance(case, Case)
        return case

    @cached_property
    def nodeid(self) -> str:
        """Node id, one string for each item: other plugins keep what they know of a test by its ``id()``."""
        return f"{ITEM_PREFIX}{self.case.item_id}]"

    @cached_property
    def id(self) -> Any:
        """Node id in parts; pytest has it since 9.2."""
        return type(super().id).parse(self.nodeid)


class PairModule(pytest.Module):
    """Module of the pairs, under a node id that is the same on every machine.

    Its one test is found whatever the ini file says of the names of tests.
    """

    def funcnamefilter(self, name: str) -> bool:
        return name == TEST_NAME

    def classnamefilter(self, name: str) -> bool:
        return False

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        for item in super().collect():
            # Where no case is left, pytest makes an item all the same, to say that it is skipped.
            parameters = getattr(item, "callspec", None)
            if parameters is not None and isinstance(parameters.params.get(CASE_FIXTURE), Case):
                item.__class__ = PairItem  # pytest makes the items of a function itself
                yield item


def settings_of(config: pytest.Config) -> Settings:
    """Return the settings, resolved once."""
    if SETTINGS not in config.stash:
        config.stash[SETTINGS] = options.resolve(config)
    return config.stash[SETTINGS]


def cases_of_run(config: pytest.Config) -> RunCases:
    """Return the cases of the run before ``-k`` and ``-m``, chosen once."""
    if CASES not in config.stash:
        config.stash[CASES] = RunCases(settings_of(config))
    return config.stash[CASES]


def cases_of(config: pytest.Config) -> tuple[Case, ...]:
    """Return the cases of the run before ``-k`` and ``-m``, in the order of play.

    Raises:
        pytest.UsageError: The track or manifest is unusable, nothing that it needs is installed, or there are
            more shards than it can make.
    """
    with usage_errors():
        return cases_of_run(config).chosen


def asked_for(config: pytest.Config) -> list[str]:
    """Return the options that leave cases out, apart from the shard, as the command line spells them."""
    option, asked = config.option, cases_of_run(config).asked
    asked += [f"-k {option.keyword}"] if option.keyword else []
    asked += [f"-m {option.markexpr}"] if option.markexpr else []
    asked += [f"--deselect={prefix}" for prefix in option.deselect or ()]
    nodes = [arg.replace(f"{PAIRS_FILE}::", f"{PSEUDO_PATH}::") for arg in config.args if _names_a_pair(arg)]
    return asked + (nodes if len(nodes) <= _LISTED_NODES else [f"{len(nodes)} node ids"])


def chosen_by_hand(config: pytest.Config) -> bool:
    """Return True if the user chooses pairs by name or marker, not by number alone."""
    option = config.option
    return bool(option.keyword or option.markexpr or any(_names_a_pair(arg) for arg in config.args))


def _names_a_pair(arg: str) -> bool:
    return arg.startswith(f"{PAIRS_FILE}::")


def aim(config: pytest.Config) -> None:
    """Resolve the pairs on the command line.

    ``libero-max`` and ``libero-max::...`` stand for the pairs; a policy on the command line without any
    path means nothing but the pairs.

    Raises:
        pytest.UsageError: The pairs are asked for where a file or folder has their name.
    """
    named = options.policy_on_command_line(config) or options.policy_in_ini_file(config)
    meant = any(arg.partition("::")[0] == PSEUDO_PATH for arg in config.args)
    if named and meant and Path(PSEUDO_PATH).exists():
        raise pytest.UsageError(
            f"{PSEUDO_PATH} stands for the pairs, but here is a file or folder of that name. Rename it, or "
            f"write ./{PSEUDO_PATH} for it."
        )
    unaimed = config.args_source is not pytest.Config.ArgsSource.ARGS
    if unaimed and options.policy_on_command_line(config):
        config.args = [str(PAIRS_FILE)]
        return
    config.args = [_resolve(arg) for arg in config.args]


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Let ``libero-max`` in the ini file's ``testpaths`` stand for the pairs, before pytest looks for it."""
    paths = early_config.getini("testpaths")
    paths[:] = map(_resolve, paths)  # the list that pytest itself keeps


def is_run(config: pytest.Config) -> bool:
    """Return True if this session plays the pairs: a policy is named, and the pairs are asked for.

    A policy on the command line is always meant for the pairs. One in the ini file is also there for tests of
    the user's own, so the pairs have to be among the test paths.
    """
    if options.policy_on_command_line(config):
        return True
    return aims_at_pairs(config) and options.policy_in_ini_file(config)


def aims_at_pairs(config: pytest.Config) -> bool:
    """Return True if the pairs are among the test paths."""
    return any(_resolve(arg).startswith(str(PAIRS_FILE)) for arg in config.args)


def only_lists(config: pytest.Config) -> bool:
    """Return True if this session lists or plans tests and plays none."""
    return any(getattr(config.option, name, False) for name in _LISTING)


def _resolve(arg: str) -> str:
    path, separator, rest = arg.partition("::")
    return f"{PAIRS_FILE}{separator}{rest}" if path == PSEUDO_PATH and not Path(path).exists() else arg


def pytest_report_header(config: pytest.Config) -> str | None:
    """Return a note on a session that plays no pair though it has options for them; None for others."""
    if is_run(config) or config.getoption("libero_max_conform", None) is not None:
        return None
    if not options.policy_in_ini_file(config):
        asked = options.on_command_line(config)
        return f"libero-max: no policy is named, so {asked} plays no pair" if asked else None
    policy = options.ini_value(config, "libero_max_policy")
    return f"libero-max: policy {policy} is for tests that ask for it; to play the pairs: pytest libero-max"


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    """Return the collector of the pairs; None for any other module."""
    if module_path != PAIRS_FILE:
        return None
    return PairModule.from_parent(parent, path=module_path, nodeid=PSEUDO_PATH)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the pairs that a resumed run has settled, the same ones on every worker."""
    on_worker: dict[str, list[str]] = getattr(config, "workerinput", {})
    settled = {*on_worker.get(SETTLED_INPUT, ()), *config.stash.get(SETTLED, ())}
    if settled:
        done = [item for item in items if case_of_item(item) in settled]
        items[:] = [item for item in items if case_of_item(item) not in settled]
        config.hook.pytest_deselected(items=done)


def check_ids(config: pytest.Config, case_set: str) -> None:
    """Check the pairs that the command line names one by one, or raise pytest.UsageError."""
    ids = [id for arg in config.args if (id := _id_in(arg)) is not None]
    if not ids:
        return
    known = {case.item_id for case in cases_of(config)}
    for id in ids:
        if id in known:
            continue
        whole = {case.item_id for case in cases_of_run(config).manifest}
        if id in whole:
            raise pytest.UsageError(
                f"{PSEUDO_PATH}::test_pair[{id}] is in {case_set}, but not among the "
                f"{counted(len(known), 'pair')} that --libero-max-suites, --libero-max-only-installed, "
                "--libero-max-limit or --libero-max-shard leaves. Take the option away."
            )
        raise pytest.UsageError(
            f"{PSEUDO_PATH}::test_pair[{id}] is not in {case_set}. {did_you_mean(id, whole)}"
        )


def _id_in(arg: str) -> str | None:
    """Item id of the case that a resolved argument names."""
    start = f"{PAIRS_FILE}::test_pair["
    return arg[len(start) :].removesuffix("]") if arg.startswith(start) else None


def register_markers(config: pytest.Config, *, in_use: bool) -> None:
    """Declare the markers of the events, suites and variants, for ``--markers`` and ``--strict-markers``.

    Args:
        in_use: True in a session that plays pairs; only there are those of other packages looked for.
    """
    names = EVENTS if in_use else BENCHMARK_EVENTS
    for event in names:
        _register(config, event, "with this event")
    for family in families() if in_use else BENCHMARK_FAMILIES:
        _register(config, family, "with an event of this family")
    for suite in SUITES if in_use else SUITES.ours:
        _register(config, suite, "of this suite")
    for variant in VARIANTS:
        _register(config, f"variant_{variant}", "with this parameter variant")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Give every test that asks for a case one item a case."""
    if CASE_FIXTURE not in metafunc.fixturenames:
        return
    cases = cases_of(metafunc.config)
    _register_sources(metafunc.config, cases)
    metafunc.parametrize(
        CASE_FIXTURE,
        [
            pytest.param(
                case, id=case.item_id, marks=[getattr(pytest.mark, name) for name in markers_of(case)]
            )
            for case in cases
        ],
    )


def _register_sources(config: pytest.Config, cases: tuple[Case, ...]) -> None:
    """Declare the markers that depend on the manifest, which is read only where a test asks for a case."""
    for event in sorted({case.event.name for case in cases}.difference(BENCHMARK_EVENTS)):
        _register(config, event, "with this event")
        _register(config, family_of(event), "with an event of this family")
    for source in sorted({case.source for case in cases}):
        _register(config, f"source_{source}", "from this source")
    for category in sorted({category_marker(case) for case in cases}):
        _register(config, category, "of this source category")


def _register(config: pytest.Config, marker: str, pairs: str) -> None:
    line = f"{marker}: LIBERO-MAX pairs {pairs}"
    if line not in config.getini("markers"):
        config.addinivalue_line("markers", line)


def case_of(item_node_id: str) -> str | None:
    """Item id of the case that a pair's node id names, or None for any other test."""
    if not item_node_id.startswith(ITEM_PREFIX):
        return None
    return item_node_id[len(ITEM_PREFIX) :].split("]", 1)[0]


def case_of_item(item: pytest.Item) -> str | None:
    """Item id of the case that an item plays, or None for any other test."""
    return item.case.item_id if isinstance(item, PairItem) else None
