"""The end of a run: its gates are decided, its reports written and its exit status explained."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import pytest

from pytest_libero_max.benchmark.documents import Json, printable
from pytest_libero_max.errors import class_name, text_of
from pytest_libero_max.evaluation.keeper import RunKeeper, problem_text
from pytest_libero_max.evaluation.processes.deaths import refused_lines, set_aside_lines
from pytest_libero_max.plugin.collection import asked_for, only_lists
from pytest_libero_max.plugin.hookspec import call_user_hook
from pytest_libero_max.plugin.junit_file import gate_case, tell_junit
from pytest_libero_max.plugin.options import places_of
from pytest_libero_max.plugin.processes.workers import number_of_workers
from pytest_libero_max.plugin.run_stop import RunStop
from pytest_libero_max.plugin.stash_keys import END_STATUS
from pytest_libero_max.policies.clients.address import LEFT_OUT
from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE
from pytest_libero_max.report.formats import counted
from pytest_libero_max.report.sections import with_sections
from pytest_libero_max.report.writers.junit import headline_properties
from pytest_libero_max.runs.media import MOST_FILMS, films_in, show_command
from pytest_libero_max.runs.store import read_pairs

if TYPE_CHECKING:
    from pytest_libero_max.report.comparison.comparison_document import Comparison
    from pytest_libero_max.report.report_document import Report


class RunEnd:
    """Plugin beside the controller, which calls :meth:`decide` and :meth:`finish`; it prints the summary."""

    def __init__(self, config: pytest.Config, keeper: RunKeeper, stop: RunStop) -> None:
        self.config, self.keeper, self.settings = config, keeper, keeper.settings
        self.lines: list[str] = []
        self.quiet: list[str] = []
        self.notes: list[str] = []  # failures beside the pairs, for example of a film
        self._query_times: str | None = None
        self._stop = stop
        self._filmed: list[str] = []
        self._verified: dict[str, str] = {}
        self._not_repeated: list[str] = []

    def decide(self) -> None:
        """End the run and decide its gates, before other plugins write their files; JUnit files hold them."""
        from pytest_libero_max.report.page.origin import query_times_text

        keeper = self.keeper
        keeper.end()
        if keeper.records:
            self._query_times = query_times_text(keeper.records)
        if only_lists(self.config):
            return
        decided = {verdict.gate.text: verdict for verdict in keeper.verdicts}
        cases = [gate_case(gate.text, decided.get(gate.text), keeper.replay) for gate in self.settings.gate]
        tell_junit(self.config, () if keeper.report is None else headline_properties(keeper.report), cases)

    def finish(self, session: pytest.Session) -> None:
        """Write the reports and decide the exit status. A failure is reported and hides nothing else."""
        if self.keeper.store is None:
            self._say_why_no_pair(session)
            self._fail_gates_without_pairs(session)
            self.config.stash[END_STATUS] = int(session.exitstatus)
            return
        ended = session.exitstatus
        # What follows calls hooks of users, which may do anything: the status is decided before.
        _, session.exitstatus = self._status(session)
        self.config.stash[END_STATUS] = int(session.exitstatus)
        try:
            self._film(ended)
        except Exception as error:
            self.notes.append(f"no films: {problem_text(error)}")
        try:
            again = self._verify(ended)
        except Exception as error:
            again = [f"Played again: no pair: {problem_text(error)}"]
        try:
            self._report()
        except Exception as error:
            self.keeper.problems.append(f"There is no report: {problem_text(error)}")
        self.lines += [*self._filmed, *again, *_few_lines(self.notes)]
        self.lines += dict.fromkeys([*self._not_repeated, *self.keeper.problems])
        session.exitstatus = ended
        said, session.exitstatus = self._status(session)
        self.config.stash[END_STATUS] = int(session.exitstatus)
        self.lines += said
        # pytest and Python look through all objects several times more before the process ends: at 80,000
        # pairs for more than a minute.
        self.keeper.report = self.keeper.run = None

    def _film(self, ended: int) -> None:
        """Make the films that the options ask for, unless the user has interrupted the run."""
        keeper = self.keeper
        if self.settings.film.which == "none" or keeper.report is None:
            return
        from pytest_libero_max.plugin.run_films import chosen_for_films, make_films

        records, selected = chosen_for_films(self.settings, keeper.records, keeper.report.changed_pairs)
        folder = _relative(self.settings.output, self.config.invocation_params.dir)
        later = f"libero-max film {folder} --select={self.settings.film.which}"
        if not records:
            return
        if ended == pytest.ExitCode.INTERRUPTED:
            self._filmed.append(f"Films: none was made of an interrupted run; to make them: {later}")
            return
        begun = time.perf_counter()
        cases = {case.case_id: case for case in keeper.cases.values()}
        try:
            made, notes = make_films(self.settings, cases, records, self._processes)
        except KeyboardInterrupt:
            self._filmed.append(f"Films: interrupted; for the others: {later}")
            return
        self.notes += notes
        rest = f"; for all of them: {later}" if made < selected else ""
        seconds = time.perf_counter() - begun
        which = self.settings.film.which
        self._filmed.append(f"Filmed: {made} of {selected} {which} ({seconds:.0f} s){rest}")

    def _verify(self, ended: int) -> list[str]:
        """Play pairs again that the option asks for; return lines of the summary."""
        if not self.settings.verify:
            return []
        if not self.keeper.records or ended == pytest.ExitCode.INTERRUPTED:
            why = "the run was interrupted" if self.keeper.records else "none was measured"
            return [f"Played again: no pair, because {why}."]
        from pytest_libero_max.runs.run_verification import CANNOT_JUDGE, verification_lines, verified

        if not self.keeper.records[0].policy.get("repeatable", True):
            return [CANNOT_JUDGE]
        begun = time.perf_counter()
        run, folder = read_pairs(self.settings.output), self.config.invocation_params.dir
        self._verified = verified(run, self.settings.verify, places_of(self.config, self.settings), folder)
        lines, self._not_repeated = verification_lines(self._verified, time.perf_counter() - begun)
        return lines

    @property
    def _processes(self) -> int:
        """Number of processes that can make films; 0 where this one has played the pairs itself."""
        if self.config.pluginmanager.has_plugin("dsession"):
            return min(number_of_workers(self.config), len(os.sched_getaffinity(0)))
        return 1 if self.settings.isolate or self.settings.ray is not None else 0

    def _report(self) -> None:
        """Write the report, with what users' hooks add to it, and the lines of the summary."""
        from pytest_libero_max.report.broken import to_look_at
        from pytest_libero_max.report.comparison.comparison_sections import short_lines
        from pytest_libero_max.report.gate_text import gate_lines, github_annotations
        from pytest_libero_max.report.writers.summary import quiet_lines, summary_lines

        folder, here = self.settings.output, self.config.invocation_params.dir
        keeper = self.keeper
        compared = self._compared(here)
        written = keeper.write(self._add_sections, None if isinstance(compared, str) else compared)
        report, verdicts = keeper.report, keeper.verdicts
        assert report is not None
        paths = [str(_relative(path, here)) for path in written]
        films = {item: str(_relative(folder / film, here)) for item, film in films_in(folder).items()}
        named = str(_relative(folder, here))
        look_at, ran = to_look_at(report, MOST_FILMS), report.provenance
        show = show_command(folder, named, look_at, ran)
        self.lines += summary_lines(report, paths, films, show)
        self.lines += self._suites_lines(report)
        self.lines += [] if self._query_times is None else [f"Query times: {self._query_times}"]
        self.quiet += quiet_lines(report, paths)
        if compared is not None:
            self.lines += ["", *([compared] if isinstance(compared, str) else short_lines(compared))]
        self.lines += set_aside_lines(report.pairs.invalid_pairs)
        self.lines += refused_lines(report.pairs.invalid_pairs)
        self._tell_reported(report)
        lost = [name for verdict in verdicts for name in verdict.lost]
        show = show_command(folder, named, lost[:1], ran)
        self.lines += gate_lines(verdicts, keeper.replay, show)
        if os.environ.get("GITHUB_ACTIONS") == "true":
            self.lines += github_annotations(verdicts)
            try:
                _append_step_summary(folder / "report.md")
            except OSError as error:
                self.lines.append(f"The step summary was not written: {error}")

    def _compared(self, here: Path) -> Comparison | str | None:
        """Return the comparison that was asked for, or why there is none; None where none was asked for."""
        from pytest_libero_max.plugin.run_comparison import comparison_at_the_end

        asked, run = self.settings.compare, self.keeper.run
        if asked is None or run is None:
            return None
        return comparison_at_the_end(asked, self.settings.output, run, here)

    def _suites_lines(self, report: Report) -> list[str]:
        """Return the option with which the limit takes no unsupported pair, if it took one."""
        limit, pairs = self.settings.limit, report.pairs
        if limit is None or not pairs.unsupported:
            return []
        suites = ",".join((report.policy or {}).get("suites", ()))
        return [
            f"--libero-max-limit={limit} chose before the policy was loaded, "
            f"{counted(pairs.unsupported, 'pair')} of "
            f"suites that it does not play among them. To choose among the others: add "
            f"--libero-max-suites={suites}"
        ]

    def _tell_reported(self, report: Report) -> None:
        """Tell conftest files that the reports are there."""
        from pytest_libero_max.report.run_tables import main_numbers

        told = {"report": msgspec.to_builtins(report), "numbers": main_numbers(report)}
        hook = self.config.hook.pytest_libero_max_reported
        raised = call_user_hook(hook, **told, folder=self.settings.output, config=self.config)
        if raised is not None:
            self.lines.append(f"pytest_libero_max_reported raised {raised}")

    def _add_sections(self, report: Report) -> Report:
        """Add the pairs that were played again, and let conftest files add sections, and nothing else."""
        if self._verified:
            from pytest_libero_max.runs.run_verification import TITLE

            again = {item: text or "alike" for item, text in self._verified.items()}
            report = msgspec.structs.replace(report, sections={**report.sections, TITLE: again})
        amended: Json = msgspec.to_builtins(report)
        hook = self.config.hook.pytest_libero_max_report
        raised = call_user_hook(hook, report=amended, config=self.config)
        if raised is None:
            try:
                return with_sections(report, amended)
            except Exception as error:  # of what the hook has put there
                raised = f"{class_name(error)}: {text_of(error)}"
        self.lines.append(f"The report has no sections of your own: {raised}")
        return report

    def _say_why_no_pair(self, session: pytest.Session) -> None:
        """Name the options that leave no case, which pytest says with one process and pytest-xdist never."""
        asked = asked_for(self.config)
        if session.exitstatus != pytest.ExitCode.NO_TESTS_COLLECTED or not asked or only_lists(self.config):
            return
        limit = "" if self.settings.limit is None else " The limit chooses first, -k and -m among its cases."
        self.lines.append(
            f"No pair was chosen: {', '.join(asked)} leave none "
            f"of {counted(len(self.keeper.run_cases.manifest), 'case')}.{limit}"
        )

    def _fail_gates_without_pairs(self, session: pytest.Session) -> None:
        """Fail a session whose gates cannot be decided because it planned no pair."""
        if not self.settings.gate or only_lists(self.config):
            return
        self.lines.append(
            f"gate open  {counted(len(self.settings.gate), 'gate')}: undecidable, no pair was planned."
        )
        if session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = GATE_FAILED
            self.lines.append(f"Exit status {GATE_FAILED}: there are gates, and no pair to decide them on.")

    def _status(self, session: pytest.Session) -> tuple[list[str], int]:
        """Return the status of the run, which is pytest's unless there is more to say, and its lines."""
        if self._stop.status is not None:
            return [
                f"Exit status {self._stop.status:d}: the run was stopped. Repair what broke and continue "
                "with --libero-max-resume."
            ], self._stop.status
        report = self.keeper.report
        pairs = None if report is None else report.pairs
        status = session.exitstatus
        if status == pytest.ExitCode.NO_TESTS_COLLECTED and self.keeper.settled:
            status = pytest.ExitCode.OK  # everything was measured before
        if status == pytest.ExitCode.INTERRUPTED and (self._stop.broken or session.shouldfail):
            # xdist takes a stop, also that of -x, for an interruption.
            status = pytest.ExitCode.TESTS_FAILED
        if status == pytest.ExitCode.INTERRUPTED and pairs is not None and pairs.missing:
            return [
                f"Interrupted. Measured and kept: {pairs.played} of {counted(pairs.planned, 'pair')}. "
                "Give the same command with --libero-max-resume to play the others."
            ], status
        if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
            return [], status
        ending = self.keeper.ending()
        if self._not_repeated and (ending is None or not self.keeper.problems):
            ending = INCOMPLETE, "not all pairs that were played again came out alike."
        if ending is not None:
            return [f"Exit status {ending[0]}: {ending[1]}"], ending[0]
        assert pairs is not None
        if pairs.complete:
            return [], status
        return [
            f"Exit status {status:d}: the run ended by its stopping rule, which left out {pairs.missing} "
            f"of {counted(pairs.planned, 'pair')}. To play them, resume without the rule."
        ], status

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        from pytest_libero_max.report.broken import colour_of

        if terminalreporter.verbosity < 0:
            from pytest_libero_max.report.gate_text import KEPT

            kept = (*KEPT, "::error", "::notice", "Exit status", "Interrupted")
            self.lines = [*self.quiet, *(line for line in self.lines if line.startswith(kept))]
        if self.lines:
            terminalreporter.section("libero-max")
        for line in self.lines:
            colour = colour_of(line)
            terminalreporter.write_line(printable(line), **({colour: True} if colour else {}))


def _few_lines(notes: Sequence[str]) -> list[str]:
    """Return lines for servers that were left out, and for the first other failure beside the pairs."""
    servers = [note for note in dict.fromkeys(notes) if note.startswith(LEFT_OUT)]
    others = [note for note in notes if not note.startswith(LEFT_OUT)]
    more = f" ({len(others) - 1} more like this)" if len(others) > 1 else ""
    return [*servers, *(f"Beside the pairs, which are measured: {note}{more}" for note in others[:1])]


def _append_step_summary(markdown: Path) -> None:
    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if summary:
        with open(summary, "a", encoding="utf-8") as file:
            file.write(f"{markdown.read_text(encoding='utf-8')}\n")


def _relative(path: Path, start: Path) -> Path:
    return path.relative_to(start) if path.is_relative_to(start) else path
