"""Gates before every pair is played: verdicts over the ways in which a run can still end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass

from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.gate_quantities import GATED
from pytest_libero_max.report.gates import Gate, Verdict, meets
from pytest_libero_max.report.measurable import LEAST_FIRED
from pytest_libero_max.stats.intervals import clopper_pearson
from pytest_libero_max.stats.measured import number
from pytest_libero_max.stats.outcome_table import FLOOR_BASE_RATE
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.significance import mcnemar


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


_SHARES: Mapping[str, Callable[[Ending], Ratio]] = {
    "base_sr": lambda end: Ratio(end.base, end.pairs),
    "dynamic_sr": lambda end: Ratio(end.dynamic, end.pairs),
    "conditional_regression": lambda end: Ratio(end.losses, end.base),
    "retained": lambda end: Ratio(end.dynamic, end.base),
    "trigger_coverage": lambda end: Ratio(end.fired, end.pairs),
    "response_coverage": lambda end: Ratio(end.answered, end.pairs),
    "delta": lambda end: Ratio(end.gains - end.losses, end.pairs),
}

_COUNTS: Mapping[str, Callable[[Ending], int]] = {
    "preserved_success": lambda end: end.base - end.losses,
    "gains": lambda end: end.gains,
    "regressions": lambda end: end.losses,
    "persistent_failure": lambda end: end.pairs - end.base - end.gains,
}

BOUNDED = (*_SHARES, *_COUNTS, "p_value")
"""Quantities of gates whose extremes over all endings are known."""


def values_at(gate: Gate, ends: Sequence[Ending]) -> list[float | None]:
    """Return the quantity of a gate, one of :data:`BOUNDED`, as the reports of these endings hold it."""
    if gate.name in _COUNTS:
        return [_COUNTS[gate.name](end) for end in ends]
    if gate.name == "p_value":
        return [number(10 ** mcnemar(end.losses, end.gains)) for end in ends]
    shares = [_SHARES[gate.name](end) for end in ends]
    if gate.end is None:
        return [number(share.value) for share in shares]
    if gate.name == "delta":
        counts = [(end.losses, end.gains, end.pairs) for end in ends]
        some = [*dict.fromkeys(counts)]
        known = dict(zip(some, paired_differences(some), strict=True))
        intervals = [known[one] for one in counts]
    else:
        intervals = [clopper_pearson(share) for share in shares]
    return [None if found is None else number(getattr(found, gate.end)) for found in intervals]


def verdict_at(gate: Gate, end: Ending, value: float | None) -> Verdict:
    """Return the verdict on a gate, one of :data:`BOUNDED`, in an ending with this value of its quantity."""
    too_low = end.base / end.pairs < FLOOR_BASE_RATE or end.fired / end.pairs < LEAST_FIRED
    if value is None or (GATED[gate.name].of_change and too_low):
        return "undecidable"
    return "passed" if meets(gate, value) else "failed"


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
    found = values_at(gate, ends)
    verdicts = {verdict_at(gate, end, value) for end, value in zip(ends, found, strict=True)}
    values = [value for value in found if value is not None]
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

    Args:
        seen: Counts of the pairs that are played.
        pairs: Number of all pairs.
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
