"""pytest's entry point: every hook delegates at once."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PairRecord, is_error
from pytest_libero_max.plugin import collection, options
from pytest_libero_max.plugin.fixtures import (
    libero_max_inject,
    libero_max_pair,
    libero_max_policy,
    libero_max_prefix,
    libero_max_settings,
    libero_max_substrate,
    libero_max_world,
)
from pytest_libero_max.plugin.processes.pair_process import STDERR
from pytest_libero_max.plugin.stash_keys import (
    MEASURED_INPUT,
    NOTE,
    NOTE_ATTRIBUTE,
    RESULT,
    RESULT_ATTRIBUTE,
    STOP,
    STOP_ATTRIBUTE,
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

CONTROLLER = "libero-max-controller"
WORKERS = "libero-max-workers"


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    from pytest_libero_max.plugin import hookspec

    pluginmanager.add_hookspecs(hookspec)


def pytest_addoption(parser: pytest.Parser) -> None:
    options.add_options(parser)


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    collection.aim_testpaths(early_config)


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Let xdist hand out contiguous blocks, so that neighbours share a scene that is built once.

    Where the order of play matters, it hands out one pair after another.
    """
    if collection.is_run(config) and config.getoption("numprocesses", None) and _no_dist_chosen(config):
        config.option.dist = "worksteal"
        if options.in_order(config):
            config.option.dist = "load"
            if config.getoption("maxschedchunk", None) is None:
                config.option.maxschedchunk = 1


def _no_dist_chosen(config: pytest.Config) -> bool:
    return bool(config.getoption("dist", "no") == "no")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    collection.aim(config)
    in_use = collection.is_run(config)
    if not in_use and config.getoption("libero_max_gate"):
        raise pytest.UsageError(
            "--libero-max-gate is given, but no pair is played: a gate that nothing decides would pass. Name "
            "a policy with --libero-max-policy."
        )
    collection.register_markers(config, in_use=in_use)
    if in_use:
        from pytest_libero_max.worlds.threads import use_one_blas_thread

        use_one_blas_thread()
    if in_use and hasattr(config, "workerinput"):
        from pytest_libero_max.plugin.processes.pair_process import keep_from_children
        from pytest_libero_max.plugin.stopping import PairGate

        keep_from_children(config)
        config.pluginmanager.register(PairGate(config))
    elif in_use:
        from pytest_libero_max.plugin.controller import RunController
        from pytest_libero_max.plugin.processes.workers import Workers, let_workers_restart

        controller = RunController(config)
        config.pluginmanager.register(controller, CONTROLLER)
        for plugin in (controller.progress, controller.stop, controller.end):
            config.pluginmanager.register(plugin)
        if controller.settings.ray is not None:
            from pytest_libero_max.plugin.ray.session import RayRun

            ray_run = RayRun(
                config, controller.settings, controller.cases, controller.progress, controller.stop
            )
            config.pluginmanager.register(ray_run, WORKERS)
        elif config.getoption("tx", None):
            config.pluginmanager.register(
                Workers(config, controller.settings, controller.cases, controller.stop), WORKERS
            )
            let_workers_restart(config, controller.settings, len(controller.cases))
        else:
            config.stash[STDERR] = os.dup(2)


def pytest_report_header(config: pytest.Config) -> str | None:
    """Say what a policy in the ini file does where the pairs are not among the tests."""
    if not options.policy_in_ini_file(config) or collection.is_run(config):
        return None
    policy = config.getini("libero_max_policy")
    return f"libero-max: policy {policy} is for tests that ask for it; to play the pairs: pytest libero-max"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the pairs that a resumed run has measured."""
    measured = set(_measured(config))
    if measured:
        done = [item for item in items if collection.case_of_item(item) in measured]
        items[:] = [item for item in items if collection.case_of_item(item) not in measured]
        config.hook.pytest_deselected(items=done)


def _measured(config: pytest.Config) -> Iterable[str]:
    controller: Any = config.pluginmanager.get_plugin(CONTROLLER)
    on_worker: dict[str, list[str]] = getattr(config, "workerinput", {})
    return on_worker.get(MEASURED_INPUT, ()) if controller is None else tuple(controller.measured)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module | None:
    if module_path != collection.PAIRS_FILE:
        return None
    return collection.PairModule.from_parent(parent, path=module_path, nodeid=collection.PSEUDO_PATH)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    collection.parametrize(metafunc)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Send the pair's record to the controller, once, as JSON types."""
    report = yield
    result = item.stash.get(RESULT, None)
    if result is not None and call.when == ("setup" if is_error(result) else "call"):
        setattr(report, RESULT_ATTRIBUTE, result)
        setattr(report, NOTE_ATTRIBUTE, item.stash.get(NOTE, None))
        setattr(report, STOP_ATTRIBUTE, item.stash.get(STOP, None))
        del item.stash[RESULT]  # another plugin may play the item again
    return report


def pytest_report_teststatus(report: Any) -> tuple[str, str, str] | None:
    result = getattr(report, RESULT_ATTRIBUTE, None)
    if result is None or is_error(result) or report.when != "call" or not report.passed:
        return None
    from pytest_libero_max.runs.outcome_letters import status

    try:
        return status(PairRecord.from_dict(result))
    except ReportError:
        return None  # the controller stores why
