"""Controller of a run: plans the pairs, receives every record and stores it."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Generator, Iterable
from datetime import datetime
from time import time
from typing import TYPE_CHECKING, Any, NoReturn

import pytest

from pytest_libero_max.benchmark.cases import SUITE_BUDGETS, Case
from pytest_libero_max.benchmark.documents import Json, known
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import (
    ActionError,
    AdapterError,
    DiskError,
    LiberoMaxError,
    OtherRunError,
    RefusalError,
    ReportError,
)
from pytest_libero_max.events.registry import EVENTS, families
from pytest_libero_max.pairing.record import PairError, PairRecord, is_error, result_from_dict
from pytest_libero_max.plugin.case_support import require_support
from pytest_libero_max.plugin.collection import (
    asked_for,
    case_of,
    cases_of,
    cases_of_all_shards,
    check_ids,
    chosen_by_hand,
    left_out_by_program,
    manifest_of,
    markers_of,
    only_lists,
    settings_of,
)
from pytest_libero_max.plugin.junit_file import tell_junit
from pytest_libero_max.plugin.options import gates_from, usage_errors
from pytest_libero_max.plugin.pair_reports import RECORD_PHASE, keep_status, result_of
from pytest_libero_max.plugin.processes.workers import number_of_workers
from pytest_libero_max.plugin.progress_display import RunProgress
from pytest_libero_max.plugin.resource_checks import memory_note, require_disk_space
from pytest_libero_max.plugin.run_end import RunEnd
from pytest_libero_max.plugin.run_stop import RunStop
from pytest_libero_max.plugin.stash_keys import (
    DIST_NOTE,
    NOTE_ATTRIBUTE,
    POLICY_PHASE,
    RESULT_ATTRIBUTE,
    RUN_BEGUN,
    RUN_BEGUN_INPUT,
    SETTLED,
    SETTLED_INPUT,
    STOP_ATTRIBUTE,
)
from pytest_libero_max.plugin.user_hooks import call_user_hook
from pytest_libero_max.policies.adapter_digest import adapter_digest
from pytest_libero_max.policies.clients.address import is_served
from pytest_libero_max.policies.clients.servers import Servers, read_servers, require_known_marks
from pytest_libero_max.policies.contract import CHANCE_SHARE
from pytest_libero_max.policies.loading import check_reference
from pytest_libero_max.report.diagnosis import changed_pairs
from pytest_libero_max.report.exit_status import INCOMPLETE
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.report_document import ChangedPair
from pytest_libero_max.report.writers.junit import broken_properties, suite_properties
from pytest_libero_max.runs import provenance
from pytest_libero_max.runs.damaged_lines import damage_said
from pytest_libero_max.runs.kept_fingerprint import kept
from pytest_libero_max.runs.lock import require_free
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.store import PairStore, StoredRun, read_to_resume, require_writable
from pytest_libero_max.studies.playable import require_playable
from pytest_libero_max.substrates.registry import SUBSTRATES, describe_substrate, scores_of
from pytest_libero_max.worlds.rendering import gl

if TYPE_CHECKING:
    from pytest_libero_max.report.stopping_rule import NamedRule

_OF_THE_POLICY = (AdapterError.__name__, RefusalError.__name__, ActionError.__name__)

STOP_AFTER_ERRORS = 8
"""Pairs that end in the same error of the policy, none being measured, after which a run is stopped."""


class RunController:
    """Registered on the controller of a distributed run, or on the only process of a plain one.

    Attributes:
        progress: Plugin that shows the progress.
        stop: Plugin that stops the run.
        end: Plugin that reports at the end.

    Raises:
        pytest.UsageError: A pair or the adapter cannot exist as named, or a LIBERO or an OpenGL backend that
            is asked for is not installed; at the start of the session: the output folder cannot be written
            to, a gate cannot be used, or the run to resume cannot be read.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.settings = settings_of(config)
        check_ids(config)
        self.progress = RunProgress(config, self.settings.progress)
        self.stop = RunStop(config, self.settings)
        self.end = RunEnd(config, self.settings, self.stop)
        self.cases = {case.item_id: case for case in cases_of(config)}
        # Taken before any policy is loaded, which could alter them in this process.
        self._budgets = {name: case.budget for name, case in self.cases.items()}
        self.store: PairStore | None = None
        self._before: StoredRun | None = None
        self._settled_before = 0, 0  # pairs that a resumed run has measured, and refused
        self._remark: str | None = None  # of the stopping rule
        self._changed: list[ChangedPair] = []
        self._settled_now: dict[str, bool] = {}  # by item id; False for a fault
        self._measured_any = False
        self._collected: list[str] = []  # node ids, by the first worker of xdist
        self._hook_raised = False
        self._adapter_errors: Counter[str] = Counter()  # pairs by message
        with usage_errors():
            check_reference(self.settings.reference, self.settings.profile, self.settings.revision)
            self._served = self._read_servers()
            if self.settings.ray is None:  # otherwise its nodes draw
                gl.check()
            self.substrate = describe_substrate(self.settings.substrate, self.settings.substrate_options)
            self._require_support()
            if self.settings.resume and not only_lists(config):
                require_free(self.settings.output)
                self._read_to_resume()
        before: Json = {} if self._before is None else self._before.run.provenance
        config.stash[RUN_BEGUN] = (
            datetime.fromisoformat(before["started"]).timestamp() if before.get("started") else time()
        )

    @property
    def has_all(self) -> bool:
        """True if a resumed run has settled all pairs already, so that no worker is needed."""
        return self.cases.keys() <= set(self.settled)

    @property
    def settled(self) -> tuple[str, ...]:
        """Item ids of the pairs of a resumed run that are not played again: measured, or refused."""
        return self.config.stash.get(SETTLED, ())

    def _chance_line(self) -> list[str]:
        """Return a line on a served policy that is not repeatable by its profile."""
        groups = () if self._served is None else self._served.groups
        known = ("repeatable", "declared_by_server")  # here, or by the server itself
        noisy = dict.fromkeys(
            group.profile.name
            for group in groups
            if not any(group.profile.get("policy", key, False) for key in known)
        )
        if not noisy:
            return []
        share = CHANCE_SHARE if self.settings.sham is None else self.settings.sham
        return [
            f"libero-max: profile {', '.join(noisy)} is of a policy that draws noise of its own; unless its "
            f"server takes seeds, {share:.0%} of the pairs measure how much of what changes is chance "
            "(--libero-max-sham)"
        ]

    @property
    def servers(self) -> Servers | None:
        """The servers of the policy; None for a single one that answers all pairs, and for other policies."""
        served = self._served
        return served if served and (len(served.addresses) > 1 or served.groups[0].marks) else None

    def _read_servers(self) -> Servers | None:
        """Return the servers of the policy; None for a policy that is no server's.

        Raises:
            AdapterError: Some are for a marker that no pair can have.
        """
        settings = self.settings
        if not is_served(settings.reference):
            return None
        servers = read_servers(settings.reference, settings.profile, settings.revision).resolved()
        known = {*SUITE_BUDGETS, *EVENTS, *families()}
        require_known_marks(servers, known.union(*map(markers_of, manifest_of(self.config).cases)))
        return servers

    def _require_support(self) -> None:
        """Refuse cases that cannot play here, unless they are left out or the user has chosen the pairs."""
        settings = self.settings
        frozen_here = settings.manifest is None and SUBSTRATES[settings.substrate].plays_frozen
        if not (frozen_here or settings.only_installed or chosen_by_hand(self.config)):
            cases = list(self.cases.values())
            require_support(settings.case_set, cases, settings.substrate, settings.substrate_options)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        """Look at the output folder, which only a session that plays may touch."""
        if only_lists(self.config):
            return
        self._require_other_process()
        with usage_errors():
            require_writable(self.settings.output)
            require_free(self.settings.output)
            require_disk_space(self.settings.output, len(self.cases))
            self._require_usable_gates()
        if self.settings.stop is not None:
            with usage_errors(f"--libero-max-stop={self.settings.stop.text}: "):
                self._remark = self._checked_rule(self.settings.stop)

    def _require_other_process(self) -> None:
        """Refuse gates in the process that plays, whatever another plugin made of the options.

        Raises:
            pytest.UsageError: No worker, actor or process of its own will play the pairs.
        """
        settings = self.settings
        apart = self.config.pluginmanager.has_plugin("dsession") or settings.ray is not None
        if settings.gate and not (apart or settings.isolate or self.has_all):
            raise pytest.UsageError(
                "The pairs would be played in the process that decides the gates, and a policy could end it: "
                "another plugin or -p no:dsession keeps the workers away. Add --libero-max-isolate."
            )

    def _require_usable_gates(self) -> None:
        if self.settings.gate:
            from pytest_libero_max.report.gate_results import require_usable

            pairs = map(PlannedPair.of, manifest_of(self.config))
            chosen = [PlannedPair.of(case) for case in cases_of_all_shards(self.config)]
            start = gates_from(self.config)
            require_usable(self.settings.gate, pairs, chosen, self.settings.output, start)

    def _checked_rule(self, stop: NamedRule) -> str | None:
        """Let the stopping rule look at what is declared of the run; return its remark."""
        from pytest_libero_max.report.stopping_rule import Declared

        settings, before = self.settings, self._before
        declared = Declared(
            settings.order,
            settings.gate,
            1 if settings.shard is None else settings.shard[1],
            None if before is None else before.run.provenance,
        )
        return stop.rule.check(declared)

    def _read_to_resume(self) -> None:
        cases = {case.case_id: case for case in self.cases.values()}
        self._before = read_to_resume(self.settings.output, cases)
        if self._before is not None:
            self.end.lines += damage_said(self._before.damaged)
            before: list[PairRecord | PairError] = [*self._before.records, *self._before.refused]
            self._settled_before = len(self._before.records), len(self._before.refused)
            self.config.stash[SETTLED] = tuple(pair.item_id for pair in before)

    def pytest_report_header(self) -> list[str]:
        settings, manifest = self.settings, manifest_of(self.config)
        asked = asked_for(self.config)
        if settings.shard is not None:
            asked.append(f"shard {settings.shard[0]} of {settings.shard[1]}")
        details = [f"{counted(len(manifest), 'case')}, digest {manifest.digest[:12]}"]
        details += [] if manifest.recognition is None else [str(manifest.recognition)]
        details += [f"selection: {', '.join(asked)}"] if asked else []
        measured, refused = self._settled_before
        details += [f"{measured} measured before"] if measured else []
        details += [f"{refused} refused before, which stay refused"] if refused else []
        note = memory_note(number_of_workers(self.config), SUBSTRATES[settings.substrate])
        return [
            f"libero-max: policy {settings.policy}, {settings.case_set} ({'; '.join(details)}), "
            f"substrate {_origin(self.substrate)}, prefix {settings.prefix}{settings.extras}",
            *self._program_line(),
            *self._chance_line(),
            *([] if self.servers is None else [_servers_line(self.servers)]),
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
        left_out, program = left_out_by_program(self.config), self.settings.program
        if program is None or not left_out:
            return []
        listed = ", ".join(f"{count} of {event}" for event, count in left_out.items())
        return [
            f"program {program.name} leaves out {left_out.total()} of "
            f"{counted(len(manifest_of(self.config)), 'case')} ({listed}): {program.because}"
        ]

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker which pairs are settled, so that all collect the same, and when the run began."""
        node.workerinput[SETTLED_INPUT] = list(self.settled)
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
        chosen = {*tests, *self.settled}
        planned = [case for name, case in self.cases.items() if name in chosen]
        if not planned or self.store is not None or only_lists(self.config):
            return
        try:
            require_playable(planned, self.settings.strength, self.settings.study)
        except LiberoMaxError as error:
            pytest.exit(str(error), returncode=pytest.ExitCode.USAGE_ERROR)
        selection = Selection.choose(
            (case.case_id for case in planned),
            len(manifest_of(self.config)),
            asked_for(self.config),
            self.settings.shard,
        )
        tell_junit(self.config, suite_properties(selection, self.settings.case_set))
        run = Run.of(planned, self._provenance(selection))
        self._require_decidable(run)
        resume, stored = self.settings.resume, None
        try:
            if resume:
                store, stored = PairStore.resume(self.settings.output, run, self._before)
                self._before = None  # the records of a long run take memory
            else:
                store = PairStore(self.settings.output, run)
            store.begin()
        except LiberoMaxError as error:
            prefix = "--libero-max-resume: " if resume else ""
            pytest.exit(f"{prefix}{error}", returncode=pytest.ExitCode.USAGE_ERROR)
        self.store = store
        records = () if stored is None else stored.records
        refused = () if stored is None else stored.refused
        self._changed += changed_pairs(records)
        self.progress.begin(store, run.planned, (*records, *refused))
        self.stop.begin(run, (*records, *refused))

    def _require_decidable(self, run: Run) -> None:
        """Refuse gates and a rule that can decide nothing on the pairs that are left after -k and -m."""
        settings = self.settings
        try:
            if settings.stop is not None:
                settings.stop.rule.check_run(run)
            if settings.gate and settings.shard is None:
                from pytest_libero_max.report.gate_results import require_open

                require_open(settings.gate, run.planned)
        except LiberoMaxError as error:
            pytest.exit(str(error), returncode=pytest.ExitCode.USAGE_ERROR)

    def _provenance(self, selection: Selection) -> Json:
        settings, manifest = self.settings, manifest_of(self.config)
        by_rule = settings.stop is not None and settings.stop.rule.decides_gates
        return provenance.collect(
            policy={
                "reference": settings.reference,
                "code": adapter_digest(settings.reference, settings.profile, settings.revision),
                "horizon": settings.horizon,
                "query_interval": settings.query_interval,
                **known(
                    profile=settings.profile,
                    servers=None if self.servers is None else self.servers.to_list(),
                    revision=settings.revision,
                    restore=None if settings.restore == "native" else settings.restore,
                    adaptive=settings.adaptive,
                ),
            },
            substrate=self.substrate,
            scores=scores_of(self.settings.substrate),
            case_set={
                "name": settings.case_set,
                "digest": manifest.digest,
                "limit": settings.limit,
                **known(
                    path=None if settings.manifest is None else str(settings.manifest),
                    program=None if settings.program is None else settings.program.source,
                    released_as=None if manifest.recognition is None else str(manifest.recognition),
                ),
            },
            selection=selection.to_dict(),
            order=str(settings.order),
            stopping_rule=None if settings.stop is None else settings.stop.text,
            gates=[gate.text for gate in settings.gate] if selection.shards is not None or by_rule else [],
            protocol=settings.protocol,
            command=["pytest", *map(str, self.config.invocation_params.args)],
            folder=self.config.rootpath,
            fingerprint=kept(self.substrate),
        )

    # What arrives.

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> Generator[None, None, None]:
        self._take_in(report)
        yield
        vars(report).pop(RESULT_ATTRIBUTE, None)  # pytest keeps every report until the end

    def _take_in(self, report: pytest.TestReport) -> None:
        """Store what a report holds of a pair, and tell it."""
        result = getattr(report, RESULT_ATTRIBUTE, None)
        name = case_of(report.nodeid) if result is None else result["item_id"]
        if name not in self.cases or self.store is None or self.stop.status is not None:
            return
        # The teardown of a pair, or one that another plugin plays again: a record counts after a fault, and
        # nothing counts after a refusal.
        if name in self._settled_now and (self._settled_now[name] or result is None or is_error(result)):
            return
        pair = result_of(report, self.cases[name], self._budgets[name])
        if pair is None:
            if report.skipped:
                self.stop.stored(name, None)
            return
        if isinstance(pair, PairError) and (pair.phase == POLICY_PHASE or pair.kind in _OF_THE_POLICY):
            self._count_adapter_error(pair.message, report)
        pair = self._stored(pair, self.cases[name])
        self._settled_now[name] = isinstance(pair, PairRecord) or pair.refused
        self._measured_any |= isinstance(pair, PairRecord)
        if isinstance(pair, PairRecord):
            self._changed += changed_pairs([pair])
            keep_status(report, pair)
        note = getattr(report, NOTE_ATTRIBUTE, None)
        if note is not None:
            self.end.notes.append(note)
        self._tell(pair)
        if (reason := getattr(report, STOP_ATTRIBUTE, None)) is not None:
            self.stop.stop(reason)
        self.stop.stored(name, pair)

    def _count_adapter_error(self, message: str, report: pytest.TestReport) -> None:
        """Show an error of the policy at length once, and stop a run that so far holds nothing else."""
        self._adapter_errors[message] += 1
        found = self._adapter_errors[message]
        if found > 1:
            report.longrepr = f"As above: {message}"
        if found >= STOP_AFTER_ERRORS and not self._settled_before[0] and not self._measured_any:
            self.stop.stop(f"{found} pairs ended in the same error of the policy, and none was measured")

    def _stored(self, pair: PairRecord | PairError, case: Case) -> PairRecord | PairError:
        """Store a pair, or its error. An error that concerns all later pairs as well stops the session."""
        assert self.store is not None
        try:
            self.store.append(pair)
        except DiskError as error:
            self._abort(str(error), INCOMPLETE)
        except OtherRunError as error:
            self._abort(str(error), pytest.ExitCode.USAGE_ERROR)
        except ReportError as error:
            pair = PairError.of(case, error, RECORD_PHASE)
            self.store.append(pair)
        return pair

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
        tell_junit(self.config, broken_properties(self._changed))
        self.end.decide(self.store)
        try:
            yield
        finally:  # whatever another plugin's hook has raised
            self.end.finish(session, self.store, measured_before=bool(self.settled))
            _leave_out_hypothesis_summary(self.config)


def _leave_out_hypothesis_summary(config: pytest.Config) -> None:
    """Unregister Hypothesis's plugin, whose summary imports Hypothesis, in a session that did not use it."""
    plugin = config.pluginmanager.get_plugin("hypothesispytest")
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if plugin is None or terminal is None or "hypothesis" in sys.modules:
        return
    if config.getoption("--hypothesis-show-statistics", False):
        return
    reports = [report for group in terminal.stats.values() for report in group]
    # Reports of tests that other processes ran carry their statistics and failing examples.
    if not any(name.startswith("_hypothesis_") for report in reports for name in vars(report)):
        config.pluginmanager.unregister(plugin)


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
    return f"libero-max: {len(servers.addresses)} servers: {'; '.join(groups)}"
