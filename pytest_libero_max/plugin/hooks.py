"""pytest's entry point: every hook delegates at once."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.plugin import collection, options, pair_reports, session_setup
from pytest_libero_max.plugin.fixtures import (
    libero_max_inject,
    libero_max_pair,
    libero_max_policy,
    libero_max_prefix,
    libero_max_settings,
    libero_max_substrate,
    libero_max_world,
)

__all__ = [
    "libero_max_inject",
    "libero_max_pair",
    "libero_max_policy",
    "libero_max_prefix",
    "libero_max_settings",
    "libero_max_substrate",
    "libero_max_world",
]


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    from pytest_libero_max.plugin import hookspec

    pluginmanager.add_hookspecs(hookspec)


def pytest_addoption(parser: pytest.Parser) -> None:
    options.add_options(parser)


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    collection.aim_testpaths(early_config)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> Generator[None, Any, Any]:
    if hasattr(config, "workerinput") or not collection.is_run(config):
        return (yield)
    session_setup.choose_distribution(config)
    return (yield from session_setup.keep_status(config))


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    session_setup.configure(config)


def pytest_report_header(config: pytest.Config) -> str | None:
    return collection.header_without_pairs(config)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    collection.leave_out_measured(config, items)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    return collection.pair_module(module_path, parent)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    collection.parametrize(metafunc)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    pair_reports.attach_result(item, call.when, report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_report_to_serializable() -> Generator[None, dict[str, Any] | None, dict[str, Any] | None]:
    return pair_reports.packed((yield))


@pytest.hookimpl(wrapper=True)
def pytest_report_from_serializable(data: dict[str, Any]) -> Generator[None, Any, Any]:
    pair_reports.unpacked(data)
    return (yield)


def pytest_report_teststatus(report: Any) -> tuple[str, str, str] | None:
    return pair_reports.status_of(report)
