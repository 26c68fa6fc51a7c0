"""Retries of a pair whose process died, in the reports of a session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.evaluation.processes.crash_log import Death
from pytest_libero_max.evaluation.processes.deaths import Deaths
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.plugin.stash_keys import RESULT_ATTRIBUTE

RETRIED = "retried"
"""Outcome of the report of a pair that is played again, or was measured before its process died."""


class Retries(Deaths):
    """A plugin beside the one that starts the processes that play."""

    def pytest_libero_max_pair_stored(self, pair: PairRecord | PairError) -> None:
        self.stored(pair)

    def pytest_report_teststatus(self, report: Any) -> tuple[str, str, str] | None:
        """Show a pair that is played again."""
        if report.outcome != RETRIED:
            return None
        return RETRIED, "r", f"RETRIED ({report.longrepr})"

    def report_death(self, report: Any, case: Case, death: Death, play_again: Callable[[], bool]) -> None:
        """Write into the report of a failure what becomes of the pair of a dead process; see :meth:`lose`."""
        lost = self.lose(case, death, play_again)
        if isinstance(lost, PairError):
            setattr(report, RESULT_ATTRIBUTE, lost.to_dict())
            report.longrepr = f"{lost.kind}: {lost.message}"
        else:
            report.outcome, report.longrepr = RETRIED, lost
