"""pytest's entry point: the hooks and fixtures of this plugin, from the modules that they are about."""

from __future__ import annotations

import pytest

from pytest_libero_max.plugin.collection import (
    pytest_collection_modifyitems,
    pytest_generate_tests,
    pytest_load_initial_conftests,
    pytest_pycollect_makemodule,
    pytest_report_header,
)
from pytest_libero_max.plugin.fixtures import (
    libero_max_inject,
    libero_max_pair,
    libero_max_policy,
    libero_max_prefix,
    libero_max_settings,
    libero_max_substrate,
    libero_max_world,
)
from pytest_libero_max.plugin.options import pytest_addoption
from pytest_libero_max.plugin.pair_reports import (
    pytest_report_from_serializable,
    pytest_report_teststatus,
    pytest_report_to_serializable,
    pytest_runtest_makereport,
)
from pytest_libero_max.plugin.session_setup import (
    pytest_cmdline_main,
    pytest_configure,
    pytest_play_apart_from_gates,
)

__all__ = [
    "libero_max_inject",
    "libero_max_pair",
    "libero_max_policy",
    "libero_max_prefix",
    "libero_max_settings",
    "libero_max_substrate",
    "libero_max_world",
    "pytest_addoption",
    "pytest_cmdline_main",
    "pytest_collection_modifyitems",
    "pytest_configure",
    "pytest_generate_tests",
    "pytest_load_initial_conftests",
    "pytest_play_apart_from_gates",
    "pytest_pycollect_makemodule",
    "pytest_report_from_serializable",
    "pytest_report_header",
    "pytest_report_teststatus",
    "pytest_report_to_serializable",
    "pytest_runtest_makereport",
]


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    from pytest_libero_max.plugin import hookspec

    pluginmanager.add_hookspecs(hookspec)
