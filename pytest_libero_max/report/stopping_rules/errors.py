"""errors:N: stop once N pairs could not be measured."""

from __future__ import annotations

from collections.abc import Sequence

from pytest_libero_max.errors import counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.gates import Gate
from pytest_libero_max.report.stopping_rule import StoppingRule
from pytest_libero_max.runs.plan import PlannedPair


class Errors(StoppingRule):
    """Stops a run in which something is broken.

    Args:
        arguments: Number of errors, at least 1; empty for 1.
    """

    bias = None

    def __init__(self, arguments: str) -> None:
        text = arguments or "1"
        if not (text.isascii() and text.isdigit() and int(text) >= 1):
            raise ValueError("expected errors:N with an integer N of at least 1")
        self._allowed = int(text)

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        super().begin(planned, gates)
        self._left = self._allowed

    def after(self, pair: PairRecord | PairError) -> str | None:
        self._left -= isinstance(pair, PairError)
        if self._left > 0:
            return None
        return f"{counted(self._allowed, 'pair')} could not be measured"
