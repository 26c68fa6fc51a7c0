"""anytime:LEVEL: stop once a confidence sequence leaves one verdict for every gate, looking at every pair."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.formats import points
from pytest_libero_max.report.gate_bounds import Ending, GateRule, Watch
from pytest_libero_max.report.gate_quantities import GATED
from pytest_libero_max.report.gates import Gate
from pytest_libero_max.report.report_document import Watched
from pytest_libero_max.report.stopping_rule import Declared, level_of
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.stats.measured import number
from pytest_libero_max.stats.sequential import TotalSequence, log_evidence_of_change

_OF_ITS_OWN = 0.8
"""Part of the level for the quantity of a gate; the rest is shared by the counts that it needs beside."""

_COUNTS: Mapping[str, Callable[[Ending], int]] = {
    "change": lambda pair: pair.gains - pair.losses,
    "discordant": lambda pair: pair.gains + pair.losses,
    "base": lambda pair: pair.base,
    "dynamic": lambda pair: pair.dynamic,
    "losses": lambda pair: pair.losses,
    "gains": lambda pair: pair.gains,
    "fired": lambda pair: pair.fired,
    "answered": lambda pair: pair.answered,
}

_WATCHED = {
    "delta": "change",
    "base_sr": "base",
    "dynamic_sr": "dynamic",
    "regressions": "losses",
    "gains": "gains",
    "trigger_coverage": "fired",
    "response_coverage": "answered",
}
"""The count that decides a quantity of gates."""


class Anytime(GateRule):
    """Stops a run in a random order with a declared probability of error, however often it looks.

    With gates, it stops once each has one verdict in all endings of the run that a confidence sequence does
    not rule out. Over the seeds of the order, that is the verdict after all planned pairs with at least the
    probability 1 - LEVEL, for each gate. Without gates it stops once it is shown at the level that losses and
    gains are not equally likely.

    Args:
        arguments: The level, above 0 and up to 0.5; empty for 0.05.
    """

    def __init__(self, arguments: str) -> None:
        self.level: float = level_of("anytime", arguments)

    def check(self, declared: Declared) -> str | None:
        super().check(declared)
        if declared.order.seed is None or declared.order.balanced:
            raise OptionError(
                f"in the order {declared.order} the first pairs are no simple random sample of all, for "
                "which the level is proved. Add --libero-max-order=shuffled:SEED with a seed of your choice."
            )
        for gate in declared.gates:
            if gate.name not in _WATCHED or gate.operator in ("==", "!="):
                raise OptionError(
                    f"gate={gate.text!r} has no confidence sequence. Those with one: limits (>=, >, <=, <) "
                    f"for {', '.join(_WATCHED)}. Leave the gate out, or the rule."
                )
        if declared.begun is not None:
            self._require_same(declared.begun, sorted(gate.text for gate in declared.gates))
        return None

    def _require_same(self, begun: Json, gates: list[str]) -> None:
        """Refuse a level or gates that were not declared before the first pair."""
        name, _, level = (begun.get("stopping_rule") or "no rule").partition(":")
        before = sorted(begun.get("gates") or ())
        if name != "anytime" or Anytime(level).level != self.level or before != gates:
            raise OptionError(
                f"level and gates are declared before the first pair. The run that is resumed was begun with "
                f"{begun.get('stopping_rule') or 'no rule'} and the gates {before}. Resume with the same or "
                "without a rule, or choose another output folder."
            )

    def begin(self, planned: Sequence[PlannedPair], gates: Sequence[Gate]) -> None:
        super().begin(planned, gates)
        self._seen, self._evidence = Ending(), 0.0
        self._change: TotalSequence | None = None

    def after(self, pair: PairRecord | PairError) -> str | None:
        if not self.gates and isinstance(pair, PairRecord):
            if self._change is None:
                self._pairs = len(self.planned) - len(unsupported_pairs(self.planned, pair.policy))
                self._change = TotalSequence(self._pairs, self.level, -1)
            one = Ending.of(pair)
            self._seen += one
            self._change.add(one.gains - one.losses)
            self._evidence = max(self._evidence, log_evidence_of_change(self._seen.losses, self._seen.gains))
        return super().after(pair)

    def reason(self) -> str | None:
        if self.gates or self._evidence < -math.log(self.level):
            return super().reason()
        return (
            f"losses and gains are not equally likely: {self._seen.losses} lost, {self._seen.gains} gained, "
            f"p = {math.exp(-self._evidence):.2g} at any time"
        )

    def watched(self) -> list[Watched]:
        if self._change is None:
            return super().watched()
        lower, upper = self._change.least / self._pairs, self._change.most / self._pairs
        return [
            Watched(
                what="delta",
                verdict=None,
                value=None,
                lower=number(lower),
                upper=number(upper),
                level=self.level,
                not_shown=False,
                detail=f"at level {self.level:g} it is between {points(lower)} and {points(upper)} "
                f"percentage points over all {counted(self._pairs, 'pair')}.",
            )
        ]

    def watch(self, gate: Gate, pairs: int) -> Watch | None:
        own = _WATCHED[gate.name]
        beside = ["discordant"] if own == "change" and gate.end else []
        beside += ["base", "fired"] if GATED[gate.name].of_change else []
        levels = {name: self.level * (1 - _OF_ITS_OWN) / len(beside) for name in beside}
        levels[own] = self.level * (_OF_ITS_OWN if beside else 1)
        sequences = {
            name: TotalSequence(pairs, level, -1 if name == "change" else 0) for name, level in levels.items()
        }
        seen = Ending()

        def endings(pair: Ending) -> Iterable[Ending]:
            nonlocal seen
            seen += pair
            for name, sequence in sequences.items():
                sequence.add(_COUNTS[name](pair))
            return _endings(own, sequences, seen, pairs)

        return endings


def _endings(own: str, sequences: Mapping[str, TotalSequence], seen: Ending, pairs: int) -> Iterator[Ending]:
    ends = {name: (sequence.least, sequence.most) for name, sequence in sequences.items()}
    changes = [(0, 0)]
    if own == "change":
        changes = [*_changes(ends["change"], ends.get("discordant"), seen, pairs)]
    elif own in ("losses", "gains"):
        changes = [(count, 0) if own == "losses" else (0, count) for count in ends[own]]
    base = ends.get("base") or ends.get("dynamic") or (pairs,)  # without losses and gains they are the same
    for (losses, gains), completed, fired, answered in product(
        changes, base, ends.get("fired", (pairs,)), ends.get("answered", (pairs,))
    ):
        yield Ending(pairs, completed, losses, gains, fired, answered)


def _changes(
    change: tuple[int, int], discordant: tuple[int, int] | None, seen: Ending, pairs: int
) -> Iterator[tuple[int, int]]:
    """Return extreme numbers of losses and gains, at both ends of their difference."""
    for total in change:
        least = seen.gains + seen.losses + abs(total - seen.gains + seen.losses)
        for end in discordant or (least,):
            both = min(max(end, least), pairs)
            odd = (both - total) % 2
            both += -odd if both == pairs else odd
            yield (both - total) // 2, (both + total) // 2
