"""The best of several conditions on the same cases, with intervals that account for the choice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.comparison import contrasts
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval, clopper_pearson
from pytest_libero_max.stats.outcome_table import BoolArray, Ratio


@dataclass(frozen=True)
class FromBest:
    """Advantage of the best condition over another one."""

    value: float
    """Success of the best less that of the other."""
    interval: Interval
    """Simultaneous with those of all pairs of conditions."""

    @property
    def may_equal(self) -> bool:
        """True if the cases do not show that the other is worse."""
        return self.interval.lower <= 0


@dataclass(frozen=True)
class Best:
    """The condition of the highest success rate."""

    name: str
    """Its name; the first one among equals."""
    rate: Ratio
    """Its success."""
    interval: Interval
    """Of its success rate, simultaneous with those of all conditions."""
    differences: Mapping[str, FromBest]
    """From each other condition, in the order given."""


def best_of(successes: Mapping[str, BoolArray]) -> Best:
    """Find the best of m conditions.

    The highest of several rates is too high on average, and an interval for it alone misses its true rate too
    often. So the interval of its rate is at the level 1 - 0.05 / m: all m such intervals hold together with
    95%, whichever is looked at (Bonferroni). Its differences from the others are held together with those of
    all m (m - 1) / 2 pairs, for the same reason. References: J. C. Hsu (1996), Multiple Comparisons, ch. 4;
    Y. Benjamini, D. Yekutieli (2005), JASA 100:71-81.

    Args:
        successes: (n,) bool by condition, the same case at the same place in each; n and m at least 1.

    Raises:
        ReportError: There is no condition or no case.
    """
    rates = {name: Ratio(int(column.sum()), len(column)) for name, column in successes.items()}
    if not rates or not all(rate.of for rate in rates.values()):
        raise ReportError("The best of no conditions, or of no cases, does not exist.")
    name = max(rates, key=lambda condition: rates[condition].count)
    interval = clopper_pearson(rates[name], 1 - (1 - CONFIDENCE) / len(rates))
    assert interval is not None
    differences = {}
    for found in contrasts(successes):
        if name not in (found.first, found.second):
            continue
        assert found.simultaneous is not None
        low, high = found.simultaneous.lower, found.simultaneous.upper
        other = found.first if found.second == name else found.second
        value = (rates[name].count - rates[other].count) / rates[name].of
        away = Interval(low, high) if found.second == name else Interval(-high, -low)
        differences[other] = FromBest(value, away)
    return Best(name, rates[name], interval, differences)
