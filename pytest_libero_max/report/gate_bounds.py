"""Gates while pairs are played: verdicts over the ways a run can still end, and rules that watch them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from typing import ClassVar

from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.gates import Gate, Verdict, shown, value_in, verdict_in
from pytest_libero_max.report.report_document import Watched
from pytest_libero_max.report.stopping_rule import Declared, StoppingRule
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.stats import blocks
from pytest_libero_max.stats.blocks import McNemar, MeanDifference, Outcomes, Rate
from pytest_libero_max.stats.measured import mcnemar_of, rate_of, ratio_of, table_change_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio


@dataclass(frozen=True)
class Ending:
    """Counts of a set of pairs once all of them are played."""

    pairs: int = 0
    base: int = 0
    """Those that Base completes."""
    losses: int = 0
    """Those that Base alone completes."""
    gains: int = 0
    """Those that Dynamic alone completes."""
    fired: int = 0
    answered: int = 0
    """Those with a query after it."""

    @classmethod
    def of(cls, record: PairRecord) -> Ending:
        base, dynamic = record.base_success, record.dynamic_success
        return cls(1, base, base > dynamic, dynamic > base, record.triggered, record.responded)

    def __add__(self, other: Ending) -> Ending:
        return Ending(*(one + more for one, more in zip(astuple(self), astuple(other), strict=True)))

    def __mul__(self, times: int) -> Ending:
        return Ending(*(times * count for count in astuple(self)))

    @property
    def dynamic(self) -> int:
        return self.base - self.losses + self.gains

    # What follows is a row of a report, as far as these counts tell it: quantities are read from both alike.

    @property
    def outcomes(self) -> Outcomes:
        kept = self.base - self.losses
        return Outcomes(kept, self.gains, self.losses, self.pairs - self.base - self.gains)

    @property
    def base_success(self) -> Rate:
        return rate_of(self.outcomes.base)

    @property
    def dynamic_success(self) -> Rate:
        return rate_of(self.outcomes.dynamic)

    @property
    def paired_change(self) -> MeanDifference:
        return table_change_of(self.outcomes)

    @property
    def conditional_regression(self) -> Rate:
        return rate_of(self.outcomes.conditional_regression)

    @property
    def retained(self) -> blocks.Ratio:
        return ratio_of(self.outcomes.retained)

    @property
    def mcnemar(self) -> McNemar:
        return mcnemar_of(self.outcomes)

    @property
    def trigger_coverage(self) -> Rate:
        return rate_of(Ratio(self.fired, self.pairs))

    @property
    def response_coverage(self) -> Rate:
        return rate_of(Ratio(self.answered, self.pairs))


BOUNDED = (
    *("base_sr", "dynamic_sr", "delta", "p_value", "preserved_success", "gains", "regressions"),
    *("persistent_failure", "conditional_regression", "retained", "trigger_coverage", "response_coverage"),
)
"""Quantities of gates whose extremes over all endings are known."""


@dataclass(frozen=True)
class Outlook:
    """A gate over several endings."""

    verdict: Verdict | None
    """The one that all of them have; None where they differ."""
    least: float | None
    """Smallest value of the quantity; None where it has none in one of them."""
    most: float | None


def outlook(gate: Gate, endings: Iterable[Ending]) -> Outlook:
    """Return the verdict and the values of a gate, one of :data:`BOUNDED`, over endings."""
    ends = [*endings]
    if gate.name == "delta":
        # Computed together, which is much faster; each of them is then known.
        paired_differences([(end.losses, end.gains, end.pairs) for end in ends])
    values = [value for end in ends if (value := value_in(gate, end)) is not None]
    verdicts = {verdict_in(gate, end) for end in ends}
    every = len(values) == len(ends)
    least, most = (min(values), max(values)) if every else (None, None)
    one = len(verdicts) == 1
    if gate.operator in ("==", "!=") and least is not None and most is not None:
        one = one and (least == most or not least < gate.threshold < most)  # it may be met in between
    return Outlook(verdicts.pop() if one else None, least, most)


def all_endings(seen: Ending, pairs: int) -> Iterator[Ending]:
    """Return the endings among which every quantity of :data:`BOUNDED` has its extremes.

    In these all pairs to come end alike. There each quantity but the p-value is largest and smallest, because
    every single pair moves it in one direction. The p-value is largest where losses and gains are as equal as
    they can become. A gate with one verdict in all of them has it in every ending.
    """
    left = pairs - seen.pairs
    for base in (0, 1):
        for answered in (0, 1):
            yield seen + Ending(1, base, 0, 0, 1, answered) * left
            yield seen + Ending(1, base, base, 1 - base, 1, answered) * left
        yield seen + Ending(1, base) * left  # without the event both arms are the same
    lead = seen.losses - seen.gains
    level = min(left, abs(lead))
    lagging = Ending(1, gains=1, fired=1) if lead > 0 else Ending(1, base=1, losses=1, fired=1)
    yield seen + lagging * level + Ending(1, base=1, fired=1) * (left - level)


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
            cases = {pair.case_id for pair in gate.of_scope(self.planned)} - unsupported
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
