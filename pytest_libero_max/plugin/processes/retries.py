"""What becomes of a pair whose process died: it is played again some times, and then set aside."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.options import Settings
from pytest_libero_max.plugin.processes.crash_log import Death
from pytest_libero_max.plugin.processes.deaths import keep_text, pair_error
from pytest_libero_max.plugin.stash_keys import POLICY_PHASE, RESULT_ATTRIBUTE
from pytest_libero_max.plugin.stopping import RunStop

RETRIED = "retried"
"""Outcome of the report of a pair that is played again, or was measured before its process died."""

FRUITLESS = 4
"""A run stops after so many deaths in a row for each process and each time that a pair may be played."""


class Retries:
    """Counts the deaths of the processes that play pairs: a plugin beside the one that starts them.

    Args:
        settings: Of the run.
        processes: How many play at once.
        kind: What they are called: ``workers``.
        stop: Of the run.
    """

    def __init__(self, settings: Settings, processes: int, kind: str, stop: RunStop) -> None:
        self.processes = processes
        self._settings = settings
        self._kind = kind
        self._stop = stop
        self._plays: Counter[str] = Counter()
        self._measured: set[str] = set()
        self._in_a_row = 0

    def died(self, death: Death) -> None:
        """A process died. Stops the run if nothing else than deaths happens any more."""
        self._in_a_row += 1
        if self._in_a_row >= FRUITLESS * self.processes * (self._settings.retries + 1):
            self._stop.stop(
                f"{self._in_a_row} {self._kind} died one after another, and none of them measured a pair; "
                f"the last one: {death.error}"
            )

    def pytest_libero_max_pair_stored(self, pair: PairRecord | PairError) -> None:
        """Something else than deaths happens."""
        if isinstance(pair, PairRecord):
            self._measured.add(pair.item_id)
            self._in_a_row = 0

    def pytest_report_teststatus(self, report: Any) -> tuple[str, str, str] | None:
        """How a pair is shown that is played again."""
        if report.outcome != RETRIED:
            return None
        return RETRIED, "r", f"RETRIED ({report.longrepr})"

    def tell(self, report: Any, case: Case, death: Death, play_again: Callable[[], bool]) -> None:
        """Say in a report what becomes of the pair that a process was to play when it died.

        Stops the run where every other pair would end like this one. A pair of a run that has been stopped is
        not played again: it stays missing.

        Args:
            report: Of a failure.
            case: The pair.
            death: How the process died.
            play_again: Gives the pair to another process; returns whether that is possible.
        """
        if case.item_id in self._measured:  # it died between this pair and the next
            report.outcome, report.longrepr = RETRIED, f"{death.error} The pair was measured before."
            return
        self._plays[case.item_id] += 1
        plays = self._plays[case.item_id]
        keep_text(self._settings.output, case.item_id, plays, death.text)
        if plays <= self._settings.retries and self._stop.stopped is not None:
            report.outcome, report.longrepr = RETRIED, f"{death.error} The run was stopped."
            return
        if plays <= self._settings.retries and play_again():
            report.outcome, report.longrepr = RETRIED, f"{death.error} It is played again."
            return
        error = pair_error(case, death, plays)
        setattr(report, RESULT_ATTRIBUTE, error.to_dict())
        report.longrepr = f"{error.kind}: {error.message}"
        if error.phase == POLICY_PHASE:
            self._stop.stop("the policy cannot be played: it ends each process that loads it")
