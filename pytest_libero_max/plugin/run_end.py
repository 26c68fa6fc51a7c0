"""The end of a run: its reports are written, its gates decided and its exit status explained."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import pytest

from pytest_libero_max.benchmark.documents import Json, printable
from pytest_libero_max.errors import LiberoMaxError, ReportError
from pytest_libero_max.plugin.collection import only_lists
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.processes.retries import set_aside_lines
from pytest_libero_max.plugin.run_stop import RunStop
from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE, ended_as_declared
from pytest_libero_max.report.sections import with_sections
from pytest_libero_max.runs.media import films_in
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import PAIRS_NAME, PairStore, read_pairs

if TYPE_CHECKING:
    from pytest_libero_max.report.report_document import Report


class RunEnd:
    """A plugin beside the controller, which calls :meth:`finish`; it prints the summary.

    Args:
        config: Of the session.
        settings: Of the run.
        stop: Of the run.

    Attributes:
        lines: Lines of the summary, in order; those known before the end come first.
        quiet: Lines of the summary of a quiet run.
        notes: Failures beside the pairs, for example of a film.
        report: As written; None before that.
    """

    def __init__(self, config: pytest.Config, settings: Settings, stop: RunStop) -> None:
        self.config, self.settings = config, settings
        self.lines: list[str] = []
        self.quiet: list[str] = []
        self.notes: list[str] = []
        self.report: Report | None = None
        self._stop = stop

    def finish(self, session: pytest.Session, store: PairStore | None, *, measured_before: bool) -> None:
        """End the run, write its reports and decide its gates. A failure is reported and hides nothing else.

        Args:
            session: Its exit status becomes that of the run.
            store: Store of its pairs; None where none was planned.
            measured_before: True if a resumed run had pairs already.
        """
        if store is None:
            self._fail_gates_without_pairs(session)
            return
        problems: list[str] = []
        failed_gates = 0
        try:
            store.close(self._stop.stopped)
        except ReportError as error:
            problems.append(str(error))
        try:
            failed_gates = self._report(problems.append)
        except Exception as error:  # whatever it is, the pairs are measured
            text = str(error) if isinstance(error, LiberoMaxError) else repr(error)
            problems.append(f"There is no report: {text}")
        self.lines += _few_lines(self.notes)
        self.lines += problems
        self.lines += self._set_status(session, failed_gates, bool(problems), measured_before)

    def _report(self, on_problem: Callable[[str], None]) -> int:
        """Compute and write the report and decide the gates; return the number of gates that fail."""
        from pytest_libero_max.report.gate_results import decide, gate_lines, github_annotations
        from pytest_libero_max.report.writers.report_files import write_reports
        from pytest_libero_max.report.writers.summary import quiet_lines, summary_lines

        folder, here = self.settings.output, self.config.invocation_params.dir
        self.report, written = write_reports(folder, self._add_sections, on_problem)
        paths = [str(_relative(path, here)) for path in written]
        films = {item: str(_relative(folder / film, here)) for item, film in films_in(folder).items()}
        self.lines += summary_lines(self.report, paths, films)
        self.quiet += quiet_lines(self.report, paths)
        self.lines += set_aside_lines(self.report.pairs.invalid_pairs)
        self._tell_reported(self.report)
        verdicts = decide(self.settings.gate, folder, here)
        failed = not all(verdict.passed for verdict in verdicts)
        replay = replay_command(read_pairs(folder)) if failed else ()
        self.lines += gate_lines(verdicts, replay)
        if os.environ.get("GITHUB_ACTIONS") == "true":
            self.lines += github_annotations(verdicts)
            try:
                _append_step_summary(folder / "report.md", gate_lines(verdicts))
            except OSError as error:
                self.lines.append(f"The step summary was not written: {error}")
        return sum(not verdict.passed for verdict in verdicts)

    def _tell_reported(self, report: Report) -> None:
        """Tell conftest files that the reports are there."""
        from pytest_libero_max.report.numbers import main_numbers

        told = {"report": msgspec.to_builtins(report), "numbers": main_numbers(report)}
        try:
            hook = self.config.hook.pytest_libero_max_reported
            hook(**told, folder=self.settings.output, config=self.config)
        except Exception as error:  # a user's hook may raise anything, and must not cost the gates
            self.lines.append(f"pytest_libero_max_reported raised {type(error).__name__}: {error}")

    def _add_sections(self, report: Report) -> Report:
        """Let conftest files add sections to the report, and nothing else."""
        amended: Json = msgspec.to_builtins(report)
        try:
            self.config.hook.pytest_libero_max_report(report=amended, config=self.config)
            return with_sections(report, amended)
        except Exception as error:  # a user's hook may raise anything, and must not cost the report
            self.lines.append(f"The report has no sections of your own: {type(error).__name__}: {error}")
            return report

    def _fail_gates_without_pairs(self, session: pytest.Session) -> None:
        """Fail a session whose gates cannot be decided because it planned no pair."""
        if not self.settings.gate or only_lists(self.config):
            return
        self.lines.append(f"gate FAIL  {len(self.settings.gate)} gates: undecidable, no pair was planned.")
        if session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = GATE_FAILED
            self.lines.append(f"Exit status {GATE_FAILED}: there are gates, and no pair to decide them on.")

    def _set_status(
        self, session: pytest.Session, failed_gates: int, problems: bool, measured_before: bool
    ) -> list[str]:
        """Replace pytest's status where the run itself has more to say; never by OK."""
        if self._stop.status is not None:
            session.exitstatus = self._stop.status
            return [
                f"Exit status {self._stop.status:d}: the run was stopped. Repair what broke and continue "
                "with --libero-max-resume."
            ]
        pairs = None if self.report is None else self.report.pairs
        status = session.exitstatus
        if status == pytest.ExitCode.NO_TESTS_COLLECTED and measured_before:
            session.exitstatus = status = pytest.ExitCode.OK  # everything was measured before
        if status == pytest.ExitCode.INTERRUPTED and (self._stop.broken or session.shouldfail):
            # xdist takes a stop, also that of -x, for an interruption.
            session.exitstatus = status = pytest.ExitCode.TESTS_FAILED
        if status == pytest.ExitCode.INTERRUPTED and pairs is not None and pairs.missing:
            return [
                f"Interrupted: {pairs.played} of {pairs.planned} pairs are measured and kept. Give the "
                "same command with --libero-max-resume to play the others."
            ]
        if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            return []
        if problems or pairs is None:
            session.exitstatus = INCOMPLETE
            return [
                f"Exit status {INCOMPLETE}: not everything could be written. What was measured is in "
                f"{PAIRS_NAME}; libero-max report makes the reports from it."
            ]
        if not ended_as_declared(pairs):
            session.exitstatus = INCOMPLETE
            return [
                f"Exit status {INCOMPLETE}: the run is incomplete ({pairs.invalid} invalid, "
                f"{pairs.missing} missing). Repair what broke and continue with --libero-max-resume."
            ]
        if failed_gates and status == pytest.ExitCode.OK:
            session.exitstatus = GATE_FAILED
            return [
                f"Exit status {GATE_FAILED}: {failed_gates} of {len(self.settings.gate)} gates do not hold."
            ]
        if pairs.complete:
            return []
        return [
            f"Exit status {status:d}: the run ended by its stopping rule, which left out {pairs.missing} "
            f"of {pairs.planned} pairs. To play them, resume without the rule."
        ]

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        from pytest_libero_max.report.gate_results import AGAINST, AGAINST_AGAIN
        from pytest_libero_max.report.writers.broken import colour_of

        if terminalreporter.verbosity < 0:
            kept = ("gate FAIL", AGAINST, AGAINST_AGAIN, "::error", "Exit status", "Interrupted")
            self.lines = [*self.quiet, *(line for line in self.lines if line.startswith(kept))]
        if self.lines:
            terminalreporter.section("libero-max")
        for line in self.lines:
            colour = colour_of(line)
            terminalreporter.write_line(printable(line), **({colour: True} if colour else {}))


def _few_lines(notes: Sequence[str]) -> list[str]:
    """Return a line for the first failure beside the pairs, and the number of others."""
    more = f" ({len(notes) - 1} more like this)" if len(notes) > 1 else ""
    return [f"Beside the pairs, which are measured: {note}{more}" for note in notes[:1]]


def _append_step_summary(markdown: Path, gates: list[str]) -> None:
    from pytest_libero_max.report.writers.markdown import markdown_text

    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if summary:
        with open(summary, "a", encoding="utf-8") as file:
            listed = "".join(f"\n- {markdown_text(line)}" for line in gates)
            file.write(f"{markdown.read_text(encoding='utf-8')}{listed}\n")


def _relative(path: Path, start: Path) -> Path:
    return path.relative_to(start) if path.is_relative_to(start) else path
