"""Set-up of a session: the plugins that its process needs, and the way in which xdist hands out the pairs."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from pytest_libero_max.errors import OptionError
from pytest_libero_max.plugin import collection, conformance, options
from pytest_libero_max.plugin.stash_keys import DIST_NOTE, END_STATUS
from pytest_libero_max.registry import Registry
from pytest_libero_max.report.exit_status import INCOMPLETE

if TYPE_CHECKING:
    from pytest_libero_max.plugin.controller import RunController


Launcher: TypeAlias = "Callable[[RunController], object]"
"""Returns a plugin whose ``pytest_runtestloop`` plays the pairs and reports them as those of this process."""


def _accept(_: str, make: Any) -> Launcher:
    if not callable(make):
        raise ValueError("an entry point of a launcher is a class or function that makes a plugin of pytest")
    launcher: Launcher = make
    return launcher


LAUNCHERS: Registry[Launcher] = Registry(
    "launcher", "pytest_libero_max.launchers", dict, _accept, OptionError
)
"""Launchers, which play the pairs of a session on other machines, in the place of xdist and of this process.

An entry point of the group has the name of the option that asks for it, ``ray`` for ``--libero-max-ray``.
"""


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Set up a session, which may play pairs, may be one of its workers, or may only offer fixtures."""
    options.require_known_keys(config)
    if conformance.is_asked(config):
        conformance.aim(config)
        conformance.configure(config)
        return
    collection.aim(config)
    in_use = collection.is_run(config)
    if not in_use and config.getoption("libero_max_gate"):
        raise pytest.UsageError(
            "--libero-max-gate is given, but no pair is played: a gate that nothing decides would pass. Name "
            "a policy with --libero-max-policy."
        )
    if not in_use and collection.aims_at_pairs(config) and not collection.only_lists(config):
        raise pytest.UsageError(
            "The pairs are asked for, but no policy is named. Give --libero-max-policy=adapter.py, or set "
            "libero_max_policy in the ini file."
        )
    collection.register_markers(config, in_use=in_use)
    if not in_use:
        return
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()
    if hasattr(config, "workerinput"):
        _be_worker(config)
    else:
        _be_controller(config)


def _be_worker(config: pytest.Config) -> None:
    from pytest_libero_max.plugin.processes.sending import send_only_sendable
    from pytest_libero_max.plugin.processes.this_process import keep_from_children
    from pytest_libero_max.plugin.run_stop import PairGate

    keep_from_children(config)
    send_only_sendable(config)
    config.pluginmanager.register(PairGate(config))


def _be_controller(config: pytest.Config) -> None:
    from pytest_libero_max.plugin.controller import RunController

    controller = RunController(config)
    settings, cases = controller.settings, controller.cases
    if controller.has_all:
        config.option.tx = []
    for plugin in (controller, controller.progress, controller.stop, controller.end):
        config.pluginmanager.register(plugin)
    if settings.ray is not None:
        with options.usage_errors():
            launch = LAUNCHERS["ray"]
        config.pluginmanager.register(launch(controller))
    elif config.getoption("tx", None):
        from pytest_libero_max.plugin.processes.workers import Workers, let_workers_restart

        config.pluginmanager.register(Workers(config, settings, cases, controller.stop))
        let_workers_restart(config, settings, len(cases))
    else:
        from pytest_libero_max.plugin.processes.this_process import STDERR

        config.stash[STDERR] = os.dup(2)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> Generator[None, Any, Any]:
    """Choose the distribution of a session that plays, and its exit status."""
    if hasattr(config, "workerinput") or not collection.is_run(config):
        return (yield)
    _choose_distribution(config)
    status = yield from _keep_status(config)
    _name_what_runs_on()
    return status


def _name_what_runs_on() -> None:
    """Name what Python will wait for at its end, perhaps for ever, so that a silent wait is explained."""
    started = [thread for thread in threading.enumerate() if thread is not threading.main_thread()]
    children = sys.modules.get("multiprocessing")  # whose children it waits for as well
    started += children.active_children() if children is not None else []
    if names := ", ".join(repr(task.name) for task in started if not task.daemon):
        print(
            f"libero-max: still running: {names}. Python waits until it ends: let the adapter end what it "
            "starts, or start it with daemon=True.",
            file=sys.stderr,
        )


def _choose_distribution(config: pytest.Config) -> None:
    """Let xdist hand out contiguous blocks, so that neighbours share a scene that is built once.

    The number of workers may still be ``auto`` here; where it turns out to be 0, xdist takes the choice back.
    """
    if _workers(config):
        _choose_dist(config)


def _choose_dist(config: pytest.Config) -> None:
    """Choose how xdist hands out tests, and note a choice of the user's that cannot be that of pairs.

    All pairs are in one module, each is played once, and one that kills its worker must not come back for
    ever; so modes that group tests, often those of a project's own tests in its ini file, are replaced.
    """
    from pytest_libero_max.plugin.processes.workers import DISTS

    option, in_order = config.option, options.in_order(config)
    asked = "load" if getattr(option, "distload", False) else option.dist
    if asked in DISTS:
        return
    option.dist = "load" if in_order else "worksteal"
    if in_order and getattr(option, "maxschedchunk", None) is None:
        option.maxschedchunk = 1
    if asked != "no":
        config.stash[DIST_NOTE] = (
            f"libero-max: --dist={asked} is replaced by --dist={option.dist} in this session: pairs are "
            "handed out one by one, each to one worker"
        )


def _workers(config: pytest.Config) -> object:
    """Return what asks for workers of xdist, if anything does; ``-n 0`` wins over every other option."""
    count = getattr(config.option, "numprocesses", None)
    return count or (count is None and getattr(config.option, "tx", None))


@pytest.hookimpl(specname="pytest_cmdline_main")
def pytest_play_apart_from_gates(config: pytest.Config) -> None:
    """Let a worker play where gates are to be decided.

    What a policy does to its own process, such as ``os._exit(0)``, must not end the session. Only xdist's own
    implementation of this hook, which comes before this one, knows whether there are workers: ``-n auto`` may
    be none.

    Raises:
        pytest.UsageError: A debugger is to stop in pairs, and there are gates.
    """
    if hasattr(config, "workerinput") or not collection.is_run(config) or not _decides_what_it_plays(config):
        return
    if config.option.usepdb:
        raise pytest.UsageError(
            "--pdb plays pairs in the process that decides the gates, and a policy could end it. Leave the "
            "gates away; where the ini file has them, add -o libero_max_gate="
        )
    if not config.pluginmanager.hasplugin("xdist"):
        config.option.libero_max_isolate = True
        return
    config.option.numprocesses = 1
    config.option.tx = ["popen"]
    _choose_dist(config)


def _decides_what_it_plays(config: pytest.Config) -> bool:
    """Return True if the process that decides gates would load the policy as well."""
    workers = config.getoption("dist", "no") != "no" and config.getoption("tx", None)
    elsewhere = workers or options.given(config, "ray") or options.given(config, "isolate")
    return options.given(config, "gate") and not (elsewhere or collection.only_lists(config))


def _keep_status(config: pytest.Config) -> Generator[None, Any, Any]:
    """Return the exit status of a session that plays: 0 only where the end of its run has decided so.

    A hook of a ``conftest.py`` may end the session (``sys.exit``), or leave the end of the run out.
    """
    try:
        status = yield
    except SystemExit as leaving:
        if leaving.code:
            raise
        status = pytest.ExitCode.OK
    if status != pytest.ExitCode.OK or _plays_nothing(config):
        return status
    if END_STATUS not in config.stash:
        print(
            f"libero-max: exit status {INCOMPLETE}: the session was ended before the end of its run, by a "
            "hook of a conftest.py or of another plugin.",
            file=sys.stderr,
        )
    return config.stash.get(END_STATUS, INCOMPLETE)


def _plays_nothing(config: pytest.Config) -> bool:
    option = config.option
    return bool(collection.only_lists(config) or option.help or option.version or option.markers)
