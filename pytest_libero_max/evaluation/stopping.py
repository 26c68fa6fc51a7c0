"""The stop of a run: by its stopping rule, or because something broke."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from pytest_libero_max.evaluation.settings import Settings
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.stopped import Stopped

if TYPE_CHECKING:
    from pytest_libero_max.report.stopping_rule import CompletedPrefix


class Stop:
    """Asks the stopping rule after each pair. After a stop no pair is begun; those in flight are stored."""

    def __init__(self, settings: Settings) -> None:
        self.broken = False  # True after :meth:`stop`, where no rule asked for the end
        self._settings = settings
        self._stopped: Stopped | None = None
        self._planned = 0
        self._prefix: CompletedPrefix | None = None

    @property
    def stopped(self) -> Stopped | None:
        """Reason of the stop; None as long as the run goes on."""
        return self._stopped

    def begin(self, run: Run, settled: Iterable[PairRecord | PairError]) -> None:
        """Begin to ask the stopping rule.

        Args:
            settled: Pairs of a resumed run that are not played again. Its rule may find that nothing is to be
                played.
        """
        self._planned = len(run.planned)
        if self._settings.stop is not None:
            from pytest_libero_max.report.stopping_rule import CompletedPrefix

            self._prefix = CompletedPrefix(self._settings.stop, run.planned, self._settings.gate)
            for pair in settled:
                self.stored(pair.item_id, pair)

    def stored(self, item_id: str, pair: PairRecord | PairError | None) -> None:
        """Ask the stopping rule after a pair has been stored, or is left out as unsupported (None)."""
        if self._prefix is None or self._stopped is not None:
            return
        decision = self._prefix.add(item_id, pair)
        if decision is not None:
            self._close(decision)

    def stop(self, reason: str) -> None:
        """Stop the run because something is broken. The first reason counts."""
        if self.stopped is None:
            self.broken = True
            self._close(Stopped(reason, self._planned))

    def _close(self, stopped: Stopped) -> None:
        """Let no pair begin any more."""
        self._stopped = stopped
