"""What stopping rules have in common that stop a run once the verdict of every gate is known."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import ClassVar

from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.gate_bounds import Ending, Outlook, outlook
from pytest_libero_max.report.gates import Gate, shown
from pytest_libero_max.report.report_document import Watched
from pytest_libero_max.report.stopping_rule import Declared, StoppingRule
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs

Watch = Callable[[Ending], Iterable[Ending]]
"""Sees the counts of the next pair of a gate; returns the ways in which the run can still end."""


class GateRule(StoppingRule):
    """Stops a run once it knows the verdict that every gate has after all planned pairs.

    A pair that could not be measured makes the run incomplete, whatever follows. From then on the rule
    decides nothing, and the run is played to its end.
    """

    decides_gates: ClassVar[bool] = True

    level: float | None = None
    """Probability of a wrong verdict; None where there is none."""

    def check(self, declared: Declared) -> str | None:
        if declared.shards > 1:
            raise OptionError(
                "this rule decides gates, and those of a shard are decided on all shards together. Play the "
                "run on several machines with --libero-max-ray, or leave the rule out."
            )
        return None

    @abstractmethod
    def watch(self, gate: Gate, pairs: int) -> Watch | None:
        """Begin to watch a gate.

        Args:
            pairs: Number of pairs that it is decided on, at least 1.

        Returns:
            None where the rule never knows its verdict before the end.
        """

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        super().begin(planned, tuple(dict.fromkeys(gates)))
        self._cases: dict[Gate, set[str]] = {}
        self._watches: dict[Gate, Watch | None] = {}
        self._left: dict[Gate, int] = {}
        self._known: dict[Gate, Watched] = {}
        self._broken = False

    def after(self, pair: PairRecord | PairError) -> str | None:
        self._broken |= isinstance(pair, PairError)
        if isinstance(pair, PairError) or self._broken:
            return None
        if not self._cases:
            self._begin_to_watch(pair)
        one = Ending.of(pair)
        for gate, cases in self._cases.items():
            watch = self._watches[gate]
            if watch is not None and gate not in self._known and pair.case_id in cases:
                self._left[gate] -= 1
                ends = [*watch(one)]
                found = outlook(gate, ends)
                if found.verdict is not None:
                    self._known[gate] = self._watched(gate, found, ends)
        return self.reason()

    def reason(self) -> str | None:
        """Return the reason to stop; None to go on."""
        known = len(self._known)
        if not known or known < len(self.gates):
            return None
        return f"the verdict of {'the gate' if known == 1 else f'all {known} gates'} is known"

    def watched(self) -> list[Watched]:
        return [self._known[gate] for gate in self.gates if gate in self._known]

    def _begin_to_watch(self, record: PairRecord) -> None:
        """Count the pairs of each gate; the first record says which suites its policy supports."""
        unsupported = {pair.case_id for pair in unsupported_pairs(self.planned, record.policy)}
        for gate in self.gates:
            cases = {
                pair.case_id
                for pair in self.planned
                if pair.case_id not in unsupported
                and (gate.scope is None or DIMENSIONS[gate.scope[0]].label(pair) == gate.scope[1])
            }
            self._cases[gate], self._left[gate] = cases, len(cases)
            self._watches[gate] = self.watch(gate, len(cases)) if cases else None

    def _watched(self, gate: Gate, found: Outlook, ends: Sequence[Ending]) -> Watched:
        pairs, left = len(self._cases[gate]), self._left[gate]
        estimate = outlook(replace(gate, end=None), ends)
        other = replace(gate, end={"lower": "upper", "upper": "lower"}.get(gate.end or ""))
        words, value = [], None
        if found.verdict == "undecidable":
            words.append("Base success or the share of events is too low to say anything of the event")
        elif gate.operator not in ("==", "!="):
            low = (gate.operator in (">=", ">")) == (found.verdict == "passed")
            value = found.least if low else found.most
        if value is not None:
            words.append(
                f"it is at {'least' if low else 'most'} {shown(gate, value)} over {counted(pairs, 'pair')}"
            )
        if estimate.least is not None and estimate.most is not None:
            what = "the estimate is" if gate.end else "it is"
            words.append(
                f"{what} between {shown(gate, estimate.least)} and {shown(gate, estimate.most)} there"
            )
        how = (
            f"however the last {counted(left, 'pair')} may end"
            if self.level is None
            else f"at level {self.level:g}"
        )
        return Watched(
            what=gate.text,
            verdict=found.verdict,
            value=value,
            lower=estimate.least,
            upper=estimate.most,
            level=self.level,
            not_shown=found.verdict == "failed"
            and gate.end is not None
            and outlook(other, ends).verdict != "failed",
            detail=f"{how}: {'; '.join(words)}." if words else f"{how}.",
        )
