"""Controller of a run: plans the pairs, receives every record and stores it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterable
from typing import Any, NoReturn

import pytest

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import (
    DiskError,
    LiberoMaxError,
    OtherRunError,
)
from pytest_libero_max.evaluation.keeper import RunKeeper
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.machine import GIB, available_bytes
from pytest_libero_max.pairing.record import PairError, PairRecord, is_error, result_from_dict
from pytest_libero_max.plugin.collection import (
    asked_for,
    case_of,
    cases_of_run,
    check_ids,
    chosen_by_hand,
    only_lists,
    settings_of,
)
from pytest_libero_max.plugin.hookspec import call_user_hook
from pytest_libero_max.plugin.junit_file import tell_junit
from pytest_libero_max.plugin.options import gates_from, usage_errors
from pytest_libero_max.plugin.pair_reports import keep_status, result_of
from pytest_libero_max.plugin.processes.workers import number_of_workers
from pytest_libero_max.plugin.progress_display import RunProgress
from pytest_libero_max.plugin.run_end import RunEnd
from pytest_libero_max.plugin.run_stop import RunStop
from pytest_libero_max.plugin.stash_keys import (
    DIST_NOTE,
    NOTE_ATTRIBUTE,
    RESULT_ATTRIBUTE,
    RUN_BEGUN,
    RUN_BEGUN_INPUT,
    SETTLED,
    SETTLED_INPUT,
    STOP_ATTRIBUTE,
)
from pytest_libero_max.policies.clients.servers import Servers
from pytest_libero_max.policies.contract import CHANCE_SHARE
from pytest_libero_max.report.exit_status import INCOMPLETE
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.writers.junit import broken_properties, suite_properties
from pytest_libero_max.runs.damaged_lines import damage_said
from pytest_libero_max.substrates.contract import SubstrateKind
from pytest_libero_max.substrates.registry import SUBSTRATES


class RunController:
    """Registered on the controller of a distributed run, or on the only process of a plain one.

    Raises:
        pytest.UsageError: A pair or the adapter cannot exist as named, or a LIBERO or an OpenGL backend that
            is asked for is not installed; at the start of the session: the output folder cannot be written
            to, a gate cannot be used, or the run to resume cannot be read.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.settings = settings_of(config)
        check_ids(config, self.settings.case_set)
        self.progress = RunProgress(config, self.settings.progress)
        self.stop = RunStop(config, self.settings)
        with usage_errors():
            self.keeper = RunKeeper(
                self.settings,
                cases_of_run(config),
                PolicySource(self.settings),
                self.stop,
                gates_from(config),
                by_hand=chosen_by_hand(config),
                on_stored=self._tell,
            )
            if self.settings.resume and not only_lists(config):
                self.keeper.read_before()
        self.cases = self.keeper.cases
        self.end = RunEnd(config, self.keeper, self.stop)
        if self.keeper.before is not None:
            self.end.lines += damage_said(self.keeper.before.damaged)
        config.stash[SETTLED] = self.keeper.settled
        config.stash[RUN_BEGUN] = self.keeper.begun_s
        self._remark: str | None = None  # of the stopping rule
        self._collected: list[str] = []  # node ids, by the first worker of xdist
        self._hook_raised = False

    @property
    def has_all(self) -> bool:
        """True if a resumed run has settled all pairs already, so that no worker is needed."""
        return self.keeper.has_all

    def _chance_line(self) -> list[str]:
        """Return a line on a served policy that is not repeatable by its profile."""
        served = self.keeper.source.servers
        groups = () if served is None else served.groups
        known = ("repeatable", "declared_by_server")  # here, or by the server itself
        noisy = dict.fromkeys(
            group.profile.name
            for group in groups
            if not any(group.profile.get("policy", key, False) for key in known)
        )
        if not noisy:
            return []
        share = CHANCE_SHARE if self.settings.noise.sham is None else self.settings.noise.sham
        return [
            f"libero-max: profile {', '.join(noisy)} is of a policy that draws noise of its own; unless its "
            f"server takes seeds, {share:.0%} of the pairs measure how much of what changes is chance "
            "(--libero-max-noise=sham:SHARE)"
        ]

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        """Look at the output folder, which only a session that plays may touch."""
        if only_lists(self.config):
            return
        with usage_errors():
            self._remark = self.keeper.check_folder()

    def pytest_report_header(self) -> list[str]:
        settings, manifest = self.settings, self.keeper.run_cases.manifest
        asked = asked_for(self.config)
        if settings.shard is not None:
            asked.append(f"shard {settings.shard[0]} of {settings.shard[1]}")
        details = [f"{counted(len(manifest), 'case')}, digest {manifest.digest[:12]}"]
        details += [] if manifest.recognition is None else [str(manifest.recognition)]
        details += [f"selection: {', '.join(asked)}"] if asked else []
        measured, refused = self.keeper.settled_before
        details += [f"{measured} measured before"] if measured else []
        details += [f"{refused} refused before, which stay refused"] if refused else []
        servers = self.keeper.source.several_servers
        note = memory_note(number_of_workers(self.config), SUBSTRATES[settings.substrate.name])
        return [
            f"libero-max: policy {settings.policy}, {settings.case_set} ({'; '.join(details)}), "
            f"substrate {_origin(self.keeper.substrate)}, prefix {settings.prefix}{settings.extras}",
            *self._program_line(),
            *self._chance_line(),
            *([] if servers is None else [_servers_line(servers)]),
            *([] if note is None else [note]),
            *self._dist_line(),
            *([] if self._remark is None else [self._remark]),
        ]

    def _dist_line(self) -> list[str]:
        """Name the way to hand out tests that was replaced; ``-n auto`` may have come out as no worker."""
        replaced = DIST_NOTE in self.config.stash and self.config.getoption("tx", None)
        return [self.config.stash[DIST_NOTE]] if replaced else []

    def _program_line(self) -> list[str]:
        """Say which cases the program does not fit, and why."""
        cases, program = self.keeper.run_cases, self.settings.program
        left_out = cases.left_out_by_program
        if program is None or not left_out:
            return []
        listed = ", ".join(f"{count} of {event}" for event, count in left_out.items())
        return [
            f"program {program.name} leaves out {left_out.total()} of "
            f"{counted(len(cases.manifest), 'case')} ({listed}): {program.because}"
        ]

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker which pairs are settled, so that all collect the same, and when the run began."""
        node.workerinput[SETTLED_INPUT] = list(self.keeper.settled)
        node.workerinput[RUN_BEGUN_INPUT] = self.config.stash[RUN_BEGUN]

    # What is planned: the pairs left after -k and -m, seen here or by the workers.

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> None:
        """Plan just before the first test: a session that never gets here has played nothing."""
        failed = session.testsfailed and not self.config.option.continue_on_collection_errors
        if not failed and not self.config.pluginmanager.has_plugin("dsession"):
            self._plan(item.nodeid for item in session.items)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any, ids: list[str]) -> None:
        """Plan what the first worker has collected, and keep the ids of all that collect the same once."""
        if ids and ids == self._collected:
            ids[:] = self._collected  # xdist keeps the ids of each worker, here in the same memory
            return
        self._plan(ids)
        self._collected = list(ids)

    def _plan(self, node_ids: Iterable[str]) -> None:
        tests = Counter(name for name in map(case_of, node_ids) if name is not None)
        for name, count in tests.items():
            if count > 1:
                pytest.exit(
                    f"{name} has {count} tests, but a pair is measured once. A fixture with parameters that "
                    "every test uses, or an option like --count, multiplies the tests: keep it away from the "
                    "pairs.",
                    returncode=pytest.ExitCode.USAGE_ERROR,
                )
        chosen = {*tests, *self.keeper.settled}
        planned = [case for name, case in self.cases.items() if name in chosen]
        if not planned or self.keeper.store is not None or only_lists(self.config):
            return
        keeper, asked = self.keeper, asked_for(self.config)
        selection = keeper.selection(planned, asked)
        tell_junit(self.config, suite_properties(selection, self.settings.case_set))
        command = ["pytest", *map(str, self.config.invocation_params.args)]
        try:
            settled = keeper.plan(planned, selection, command, self.config.rootpath)
        except LiberoMaxError as error:
            pytest.exit(str(error), returncode=pytest.ExitCode.USAGE_ERROR)
        assert keeper.store is not None
        self.progress.begin(keeper.store, keeper.store.run.planned, settled)

    # What arrives.

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, None, None]:
        self._take_in(report)
        yield
        vars(report).pop(RESULT_ATTRIBUTE, None)  # pytest keeps every report until the end

    def _take_in(self, report: pytest.TestReport) -> None:
        """Store what a report holds of a pair."""
        result = getattr(report, RESULT_ATTRIBUTE, None)
        name: str | None = case_of(report.nodeid) if result is None else result["item_id"]
        # The teardown of a pair, or one that another plugin plays again, has nothing that is expected.
        is_fault = result is None or is_error(result)
        if name is None or self.stop.status is not None or not self.keeper.expects(name, is_fault=is_fault):
            return
        pair = result_of(report, self.cases[name])
        if pair is None:
            if report.skipped:
                self.stop.stored(name, None)
            return
        note = getattr(report, NOTE_ATTRIBUTE, None)
        if note is not None:
            self.end.notes.append(note)
        try:
            pair = self.keeper.add(self.keeper.checked(pair), getattr(report, STOP_ATTRIBUTE, None))
        except DiskError as error:
            self._abort(str(error), INCOMPLETE)
        except OtherRunError as error:
            self._abort(str(error), pytest.ExitCode.USAGE_ERROR)
        if isinstance(pair, PairRecord):
            keep_status(report, pair)
        elif self.keeper.adapter_errors[pair.message] > 1:  # at length once
            report.longrepr = f"As above: {pair.message}"

    def _abort(self, message: str, status: int) -> NoReturn:
        self.end.lines.append(message)
        self.stop.abort(message, status)

    def _tell(self, pair: PairRecord | PairError) -> None:
        """Pass a stored pair to conftest files; the first exception of one is reported at the end."""
        hook = self.config.hook.pytest_libero_max_pair_stored
        stops = (pytest.exit.Exception,)
        if any(one.plugin is not self.progress for one in hook.get_hookimpls()):
            # A copy, since they may write to it: as if read from the disk, faster than a deep copy.
            pair = result_from_dict(pair.to_dict())
        raised = call_user_hook(hook, may_raise=stops, pair=pair, config=self.config)
        if raised is not None and not self._hook_raised:
            self.end.lines.append(f"pytest_libero_max_pair_stored raised {raised}")
            self._hook_raised = True

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> Generator[None, None, None]:
        tell_junit(self.config, broken_properties(self.keeper.changed))
        self.end.decide()
        try:
            yield
        finally:  # whatever another plugin's hook has raised
            self.end.finish(session)


def _origin(substrate: Json) -> str:
    """Return a substrate in the header, with the installations it plays on."""
    if "installations" not in substrate:
        return str(substrate["name"])
    origin = [*substrate["installations"], f"{substrate['semantics']} events"]
    if substrate["source_variations"] == "own":
        origin.append("own source variations")
    return f"{substrate['name']} ({', '.join(origin)})"


def _servers_line(servers: Servers) -> str:
    """Return the servers of a run for pytest's header."""
    groups = [
        ", ".join(group.addresses)
        + (f" for {' '.join(group.marks)}" if group.marks else " for all other pairs")
        for group in servers.groups
    ]
    if len(groups) == 1 and not servers.groups[0].marks:
        groups = [", ".join(servers.addresses)]
    return f"libero-max: {counted(len(servers.addresses), 'server')}: {'; '.join(groups)}"


def memory_note(workers: int, kind: SubstrateKind) -> str | None:
    """Return a warning where memory is too little for the workers; None where it is enough or unknown."""
    available, each = available_bytes(), int(kind.worker_gib * GIB)
    if available is None or available >= workers * each:
        return None
    fits = max(available // each, 1)
    return (
        f"libero-max: {available / GIB:.1f} GiB of memory are free, and {counted(workers, 'worker')} would "
        f"take about {workers * each / GIB:.1f} GiB on the {kind.name} substrate, without the policy. "
        f"Play with -n {fits}, or serve the policy once for all workers (libero-max serve)."
    )
