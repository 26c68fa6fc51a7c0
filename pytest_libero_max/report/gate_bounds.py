"""Gates before every pair is played: verdicts over the ways in which a run can still end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.gates import Gate, Verdict, value_in, verdict_in
from pytest_libero_max.stats import blocks
from pytest_libero_max.stats.blocks import McNemar, MeanDifference, Outcomes, Rate
from pytest_libero_max.stats.measured import mcnemar_of, rate_of, ratio_of, table_change_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio


@dataclass(frozen=True)
class Ending:
    """Counts of a set of pairs once all of them are played."""

    pairs: int = 0
    """All pairs."""
    base: int = 0
    """Those that Base completes."""
    losses: int = 0
    """Those that Base alone completes."""
    gains: int = 0
    """Those that Dynamic alone completes."""
    fired: int = 0
    """Those in which the event happened."""
    answered: int = 0
    """Those with a query after it."""

    @classmethod
    def of(cls, record: PairRecord) -> Ending:
        """Return the counts of one pair."""
        base, dynamic = record.base_success, record.dynamic_success
        return cls(1, base, base > dynamic, dynamic > base, record.triggered, record.responded)

    def __add__(self, other: Ending) -> Ending:
        return Ending(*(one + more for one, more in zip(astuple(self), astuple(other), strict=True)))

    def __mul__(self, times: int) -> Ending:
        return Ending(*(times * count for count in astuple(self)))

    @property
    def dynamic(self) -> int:
        """Pairs that Dynamic completes."""
        return self.base - self.losses + self.gains

    # What follows is a row of a report, as far as these counts tell it: quantities are read from both alike.

    @property
    def outcomes(self) -> Outcomes:
        """Pairs by outcome."""
        kept = self.base - self.losses
        return Outcomes(kept, self.gains, self.losses, self.pairs - self.base - self.gains)

    @property
    def base_success(self) -> Rate:
        """Base success rate."""
        return rate_of(self.outcomes.base)

    @property
    def dynamic_success(self) -> Rate:
        """Dynamic success rate."""
        return rate_of(self.outcomes.dynamic)

    @property
    def paired_change(self) -> MeanDifference:
        """Paired change."""
        return table_change_of(self.outcomes)

    @property
    def conditional_regression(self) -> Rate:
        """Share of Base successes lost."""
        return rate_of(self.outcomes.conditional_regression)

    @property
    def retained(self) -> blocks.Ratio:
        """Dynamic successes over Base successes."""
        return ratio_of(self.outcomes.retained)

    @property
    def mcnemar(self) -> McNemar:
        """Test of regressions against gains."""
        return mcnemar_of(self.outcomes)

    @property
    def trigger_coverage(self) -> Rate:
        """Pairs whose event fired."""
        return rate_of(Ratio(self.fired, self.pairs))

    @property
    def response_coverage(self) -> Rate:
        """Pairs with a query after the event."""
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
    """Largest value."""


def outlook(gate: Gate, endings: Iterable[Ending]) -> Outlook:
    """Return the verdict and the values of a gate, one of :data:`BOUNDED`, over endings."""
    ends = [*endings]
    if gate.name == "delta" and gate.end is not None:
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
