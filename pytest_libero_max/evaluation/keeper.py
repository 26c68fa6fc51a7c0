"""Keeper of a run: plans its pairs, stores every result, decides the gates and writes the reports.

It is given results by whoever plays, in whatever order they arrive, and knows nothing of processes.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import (
    ActionError,
    AdapterError,
    DiskError,
    LiberoMaxError,
    OtherRunError,
    RefusalError,
    ReportError,
    class_name,
    text_of,
)
from pytest_libero_max.evaluation.case_support import require_support
from pytest_libero_max.evaluation.policy_source import PolicySource
from pytest_libero_max.evaluation.resolving import about
from pytest_libero_max.evaluation.run_cases import RunCases, markers_of
from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.evaluation.stopping import Stop
from pytest_libero_max.events.registry import EVENTS, families
from pytest_libero_max.pairing.record import POLICY_PHASE, RECORD_PHASE, PairError, PairRecord
from pytest_libero_max.report.diagnosis import changed_pairs
from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE, ended_as_declared
from pytest_libero_max.report.report_document import ChangedPair
from pytest_libero_max.runs import provenance
from pytest_libero_max.runs.lock import require_free
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import (
    PAIRS_NAME,
    PairStore,
    StoredRun,
    read_pairs,
    read_to_resume,
    require_writable,
)
from pytest_libero_max.studies.playable import require_playable
from pytest_libero_max.substrates.registry import SUBSTRATES, describe_substrate, scores_of
from pytest_libero_max.worlds.rendering import gl

if TYPE_CHECKING:
    from pytest_libero_max.report.comparison.comparison_document import Comparison
    from pytest_libero_max.report.gates import GateResult
    from pytest_libero_max.report.report_document import PairCounts, Report

STOP_AFTER_ERRORS = 8
"""Pairs that end in the same error of the policy, none being measured, after which a run is stopped."""

_OF_THE_POLICY = (AdapterError.__name__, RefusalError.__name__, ActionError.__name__)


class RunKeeper:
    """Keeps a run, from before its first pair to its reports.

    Args:
        start: Folder that paths of other runs in gates start from.
        by_hand: True if the user has chosen the pairs by name, so that one that cannot play is an error of
            its own.

    Raises:
        LiberoMaxError: The policy, the cases or the substrate cannot be played here, or the run to resume
            cannot be read.
    """

    def __init__(
        self,
        settings: Settings,
        cases: RunCases,
        source: PolicySource,
        stop: Stop,
        start: Path,
        *,
        by_hand: bool = False,
        on_stored: Callable[[PairRecord | PairError], None] | None = None,
    ) -> None:
        self.settings, self.source, self.stop = settings, source, stop
        self.run_cases = cases
        self.cases = {case.item_id: case for case in cases.chosen}
        # Taken before any policy is loaded, which could alter them in this process.
        self._budgets = {name: case.budget for name, case in self.cases.items()}
        self._start, self._on_stored = start, on_stored
        self.before: StoredRun | None = None  # a resumed run as it was read, until it goes on
        self.settled: tuple[str, ...] = ()  # item ids of the pairs of a resumed run that are not played again
        self.settled_before = 0, 0  # numbers of those that were measured and refused
        self.changed: list[ChangedPair] = []
        self.adapter_errors: Counter[str] = Counter()
        self._settled_now: dict[str, bool] = {}  # by item id; False for a fault
        self._measured_any = False
        self.store: PairStore | None = None
        self.report: Report | None = None
        self.run: Run | None = None
        self.records: Sequence[PairRecord] = ()
        self.verdicts: tuple[GateResult, ...] = ()
        self.problems: list[str] = []
        self.replay: Sequence[str] | None = None
        source.check()
        self._check_servers()
        if settings.ray is None:  # otherwise its nodes draw
            gl.check()
        self.substrate = describe_substrate(settings.substrate.name, settings.substrate_options)
        frozen_here = settings.manifest is None and SUBSTRATES[settings.substrate.name].plays_frozen
        if not (frozen_here or settings.only_installed or by_hand):
            planned = list(self.cases.values())
            require_support(settings.case_set, planned, settings.substrate.name, settings.substrate_options)

    def _check_servers(self) -> None:
        if self.source.servers is None:
            return
        from pytest_libero_max.policies.clients.servers import require_known_marks

        marks = {*SUITES, *EVENTS, *families()}
        marks |= {mark for case in self.run_cases.manifest.cases for mark in markers_of(case)}
        require_known_marks(self.source.servers, marks)

    @property
    def has_all(self) -> bool:
        """True if a resumed run has settled all pairs already."""
        return self.cases.keys() <= set(self.settled)

    @property
    def begun_s(self) -> float:
        """When the run began, before it was resumed; seconds since the epoch."""
        begun = None if self.before is None else self.before.run.provenance.get("started")
        return datetime.fromisoformat(begun).timestamp() if begun else time.time()

    def read_before(self) -> None:
        """Read the run that is to be resumed, if there is one, or raise LiberoMaxError."""
        require_free(self.settings.output)
        cases = {case.case_id: case for case in self.cases.values()}
        self.before = read_to_resume(self.settings.output, cases)
        if self.before is not None:
            self.settled_before = len(self.before.records), len(self.before.refused)
            settled: list[PairRecord | PairError] = [*self.before.records, *self.before.refused]
            self.settled = tuple(pair.item_id for pair in settled)

    def check_folder(self) -> str | None:
        """Look at the output folder and at what gates and rule could decide.

        Returns:
            The remark of the stopping rule, if it has one.
        """
        settings = self.settings
        require_writable(settings.output)
        require_free(settings.output)
        if settings.gate:
            from pytest_libero_max.report.gate_results import require_usable, require_watched

            pairs = map(PlannedPair.of, self.run_cases.manifest)
            chosen = [PlannedPair.of(case) for case in self.run_cases.of_all_shards]
            require_usable(settings.gate, pairs, chosen, settings.output, self._start)
            require_watched(settings.gate, settings.probe)
        if settings.stop is None:
            return None
        from pytest_libero_max.report.stopping_rule import Declared

        declared = Declared(
            settings.order,
            settings.gate,
            1 if settings.shard is None else settings.shard[1],
            None if self.before is None else self.before.run.provenance,
        )
        with about(f"--libero-max-stop={settings.stop.text}: "):
            return settings.stop.rule.check(declared)

    def selection(self, planned: Sequence[Case], asked: Sequence[str]) -> Selection:
        """Return the part of the case set that is played."""
        names, whole = (case.case_id for case in planned), len(self.run_cases.manifest)
        return Selection.choose(names, whole, asked, self.settings.shard)

    def plan(
        self, planned: Sequence[Case], selection: Selection, command: Sequence[str], folder: Path
    ) -> list[PairRecord | PairError]:
        """Begin the run.

        Args:
            folder: Folder whose git state the provenance names.

        Returns:
            The pairs that are settled already.
        """
        settings = self.settings
        require_playable(planned, settings.strength, settings.study, settings.latency)
        run = Run.of(planned, self._provenance(selection, command, folder))
        if settings.stop is not None:
            settings.stop.rule.check_run(run)
        if settings.gate and settings.shard is None:
            from pytest_libero_max.report.gate_results import require_connectable, require_open

            require_open(settings.gate, run.planned)
            require_connectable(settings.gate, run)
        stored = None
        if settings.resume:
            with about("--libero-max-resume: "):
                store, stored = PairStore.resume(settings.output, run, self.before, self.source.spec())
                self.before = None  # the records of a long run take memory
                store.begin()
        else:
            store = PairStore(settings.output, run)
            store.begin()
        settled: list[PairRecord | PairError] = []
        if stored is not None:
            settled += [*stored.records, *stored.refused]
            self.changed += changed_pairs(stored.records)
        try:
            self.stop.begin(run, settled)
        except BaseException:
            store.abandon()
            raise
        self.store = store
        return settled

    def _provenance(self, selection: Selection, command: Sequence[str], folder: Path) -> Json:
        settings = self.settings
        by_rule = settings.stop is not None and settings.stop.rule.decides_gates
        return provenance.collect(
            policy=self.source.provenance(),
            substrate=self.substrate,
            scores=scores_of(settings.substrate.name),
            case_set=self.run_cases.provenance,
            selection=selection.to_dict(),
            order=str(settings.order),
            stopping_rule=None if settings.stop is None else settings.stop.text,
            gates=[gate.text for gate in settings.gate] if selection.shards is not None or by_rule else [],
            protocol=settings.recorded("protocol"),
            command=command,
            folder=folder,
        )

    # What arrives.

    def expects(self, name: str, *, is_fault: bool) -> bool:
        """Return True if a result of this pair counts: a record does after a fault, nothing after a record.

        Args:
            name: Item id of the pair; one that is no pair of the run is not expected.
            is_fault: True for a result that is no record.
        """
        if name not in self.cases or self.store is None:
            return False
        return not (name in self._settled_now and (self._settled_now[name] or is_fault))

    def checked(self, result: PairRecord | PairError) -> PairRecord | PairError:
        """Return a result; an error where it contradicts its case, as that was before any policy was loaded.

        Args:
            result: As it arrived from a process in which a policy may have altered anything.
        """
        from pytest_libero_max.pairing.case_rules import require_of_case

        case, budget = self.cases[result.item_id], self._budgets[result.item_id]
        if isinstance(result, PairError):
            return result
        try:
            if result.max_steps != budget:
                raise ReportError(
                    f"max_steps={result.max_steps} of case_id={case.case_id!r}, but its episodes have "
                    f"{budget}. Something has changed the budgets where it was played: look for it in the "
                    "adapter."
                )
            require_of_case(result, case)
        except ReportError as error:
            return PairError.of(case, error, RECORD_PHASE)
        return result

    def add(self, result: PairRecord | PairError, stop: str | None = None) -> PairRecord | PairError:
        """Store a result that is expected, and stop the run where that is called for.

        Args:
            result: Of a pair.
            stop: Reason to stop the run, found where it was played.

        Returns:
            What was stored: an error where the record could not be.

        Raises:
            DiskError: It cannot be stored, and no later one could be.
            OtherRunError: It was played with something else than the run's other pairs, likewise.
        """
        assert self.store is not None
        if isinstance(result, PairError) and (result.phase == POLICY_PHASE or result.kind in _OF_THE_POLICY):
            self._count_adapter_error(result.message)
        try:
            self.store.append(result)
        except (DiskError, OtherRunError):
            raise
        except ReportError as error:
            result = PairError.of(self.cases[result.item_id], error, RECORD_PHASE)
            self.store.append(result)
        measured = isinstance(result, PairRecord)
        self._settled_now[result.item_id] = measured or (isinstance(result, PairError) and result.refused)
        self._measured_any |= measured
        if isinstance(result, PairRecord):
            self.changed += changed_pairs([result])
        if self._on_stored is not None:
            self._on_stored(result)
        if stop is not None:
            self.stop.stop(stop)
        self.stop.stored(result.item_id, result)
        return result

    def _count_adapter_error(self, message: str) -> None:
        """Stop a run that so far holds nothing but one error of the policy."""
        self.adapter_errors[message] += 1
        pairs = self.adapter_errors[message]
        if pairs >= STOP_AFTER_ERRORS and not self.settled_before[0] and not self._measured_any:
            self.stop.stop(f"{pairs} pairs ended in the same error of the policy, and none was measured")

    # The end.

    def end(self) -> None:
        """End the run and decide its gates; what cannot be done is a problem, and the pairs are measured."""
        if self.store is None:
            return
        try:
            self.store.close(self.stop.stopped)
        except ReportError as error:
            self.problems.append(str(error))
        try:
            self._decide()
        except Exception as error:  # whatever it is
            self.problems.append(f"There is no report: {problem_text(error)}")

    def _decide(self) -> None:
        """Compute the report and decide the gates; those of a shard wait for all shards."""
        from pytest_libero_max.report.gate_results import decide_on
        from pytest_libero_max.report.writers.report_files import report_of

        stored = read_pairs(self.settings.output)
        self.report, self.run, self.records = report_of(stored), stored.run, stored.records
        self.verdicts = decide_on(self.settings.gate, stored, self.report, self._start)
        if not all(verdict.passed for verdict in self.verdicts):
            self.replay = replay_command(stored)

    def write(
        self, amend: Callable[[Report], Report] | None = None, earlier: Comparison | None = None
    ) -> list[Path]:
        """Write the reports from what is on disk, and return the files to look at."""
        from pytest_libero_max.report.writers.report_files import write_reports

        self.records = ()  # so that memory holds them once
        folder = self.settings.output
        self.report, written = write_reports(folder, amend, self.problems.append, self.verdicts, earlier)
        return written

    def ending(self) -> tuple[int, str] | None:
        """Return exit status and line of a run that is incomplete, or whose gates do not hold."""
        from pytest_libero_max.report.gate_text import not_passed_text

        pairs = None if self.report is None else self.report.pairs
        if self.problems or pairs is None:
            return INCOMPLETE, (
                f"not everything could be written. What was measured is in {PAIRS_NAME}; libero-max report "
                "makes the reports from it."
            )
        if not ended_as_declared(pairs):
            return INCOMPLETE, (
                f"the run is incomplete ({pairs.invalid} invalid, {pairs.missing} missing). {_cure(pairs)}"
            )
        failed = not_passed_text([verdict for verdict in self.verdicts if not verdict.waits])
        return None if failed is None else (GATE_FAILED, failed)


def _cure(pairs: PairCounts) -> str:
    from pytest_libero_max.errors import is_refusal

    if any(is_refusal(pair.kind) for pair in pairs.invalid_pairs):
        return "Repair the policy and begin a new run: pairs that were refused stay refused."
    return "Repair what broke and continue with --libero-max-resume."


def problem_text(error: Exception) -> str:
    """Return the words for a problem: the message of an error of this package, or the whole exception."""
    return str(error) if isinstance(error, LiberoMaxError) else f"{class_name(error)}: {text_of(error)}"
