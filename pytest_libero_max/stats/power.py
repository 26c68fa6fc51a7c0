"""Power of the exact McNemar test: changes that some pairs can resolve, and pairs that a change needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import OptionError
from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.paired_difference import paired_difference

ALPHA = 0.05

MOST_PAIRS = 1_000_000
"""Number of pairs beyond which a change counts as out of reach."""

_STEP = 1e-5
"""Resolution of a minimum detectable change."""

_NEGLIGIBLE = 1e-15
"""Probability of any discordant pair below which the power counts as 0, since a rejection is as unlikely."""


def power(pairs: int, loss: float, gain: float, alpha: float = ALPHA) -> float:
    """Probability that the exact two-sided McNemar test rejects, before any pair is played.

    The number of discordant pairs is Binomial(pairs, loss + gain), the losses among them Binomial with
    probability loss / (loss + gain); the power is the sum over both. Reference: S. W. Duffy (1984),
    Biometrics 40:1005-1015. It is computed exactly, so it is slightly saw-toothed in ``pairs``.
    """
    from scipy import stats

    discordant = min(1.0, loss + gain)
    if pairs * discordant < _NEGLIGIBLE:  # also where the binomial probabilities could not be computed
        return 0.0
    spread = 12 * np.sqrt(pairs * discordant * (1 - discordant)) + 12
    first = max(0, int(pairs * discordant - spread))
    counts = np.arange(first, min(pairs, int(pairs * discordant + spread)) + 1)
    critical = _critical_counts(int(counts[-1]), alpha)[counts]
    share = loss / discordant
    rejected = stats.binom.cdf(critical, counts, share) + stats.binom.sf(counts - critical - 1, counts, share)
    reach = stats.binom.pmf(counts, pairs, discordant)
    return float(min(1.0, (reach * np.where(critical >= 0, rejected, 0.0)).sum()))


def detectable_loss(
    pairs: int, gain: float, target: float, base_rate: float = 1.0, alpha: float = ALPHA
) -> float | None:
    """Return the smallest probability of a regression that ``pairs`` resolve with the power ``target``.

    Args:
        gain: Probability of a (0, 1) pair, expected regardless of the event.
        target: Power wanted, for example 0.8.
        base_rate: Base success rate; no more than that can regress.

    Returns:
        The probability, rounded up to 1e-5; the paired change is ``gain`` less it. None where even the
        loss of every Base success would not be resolved.
    """
    most = min(base_rate, 1 - gain)
    if most <= gain or power(pairs, most, gain, alpha) < target:
        return None
    low, high = int(gain / _STEP), int(np.ceil(most / _STEP))
    while high - low > 1:
        middle = (low + high) // 2
        if power(pairs, min(middle * _STEP, most), gain, alpha) >= target:
            high = middle
        else:
            low = middle
    return min(high * _STEP, most)


def pairs_needed(loss: float, gain: float, target: float, alpha: float = ALPHA) -> int | None:
    """Return the number of pairs that resolve a change with the power ``target``; None above a million.

    Power is slightly saw-toothed in the number of pairs, so a few pairs fewer may do as well.
    """
    return fewest(lambda pairs: power(pairs, loss, gain, alpha) >= target)


def fewest(shown: Callable[[int], bool]) -> int | None:
    """Return a number from which on something is shown, found by bisection; None above a million."""
    high = 1
    while not shown(high):
        high *= 2
        if high > MOST_PAIRS:
            return None
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if shown(middle) else (middle, high)
    return high


@lru_cache(maxsize=8)
def _critical_counts(most: int, alpha: float) -> NDArray[np.int64]:
    """For 0 to ``most`` discordant pairs, the largest smaller count that rejects; -1 where none does."""
    from scipy import stats

    counts = np.arange(most + 1)
    smallest = np.asarray(stats.binom.ppf(alpha / 2, counts, 0.5), dtype=np.int64)
    beyond = np.asarray(stats.binom.cdf(smallest, counts, 0.5) > alpha / 2, dtype=np.int64)
    return smallest - beyond


Counts = NDArray[np.int64]
Begins = Callable[[Counts, Counts], NDArray[np.bool_]]
"""Tells for arrays of gains and losses whether something holds; more losses can only begin it."""

DRAWS = 400
"""Simulated runs where tasks are resampled: a probability of 95% is then known to 2 points."""

_REST = 1e-7
"""Probability that may be left out of a sum at each end."""


@dataclass(frozen=True)
class Chances:
    """Probabilities of the outcomes of a pair."""

    base: float
    """Success in Base; against another run, Dynamic success of that run."""
    loss: float
    """Base succeeds and Dynamic fails; against another run, that run succeeds and this one fails."""
    gain: float
    """Base fails and Dynamic succeeds; against another run, that run fails and this one succeeds."""

    def __post_init__(self) -> None:
        if not (0 <= self.loss <= self.base <= 1 and 0 <= self.gain <= 1 - self.base + 1e-12):
            raise OptionError(
                f"base={self.base:g}, loss={self.loss:g} and gain={self.gain:g}, but only what succeeds in "
                "Base can be lost (loss <= base), and only what fails can be gained (gain <= 1 - base)."
            )


def chance_of_losses(
    pairs: int, chances: Chances, begins: Begins | None = None, ends: Begins | None = None
) -> float:
    """Return the probability that gains and losses lie where one thing has begun and another has not.

    For each number of gains the losses at which they begin are found by bisection.

    Args:
        begins: Holds for enough losses; None where none are too few.
        ends: Holds for too many losses; None where none are.
    """
    from scipy import stats

    gains, mass = _range(pairs, chances.gain)
    trials = pairs - gains
    share = min(1.0, chances.loss / (1 - chances.gain)) if chances.gain < 1 else 0.0
    low, high = (
        alone if edge is None else stats.binom.cdf(_first(gains, trials, edge) - 1, trials, share)
        for edge, alone in ((begins, 0.0), (ends, 1.0))
    )
    return float(np.clip((mass * np.maximum(high - low, 0.0)).sum(), 0.0, 1.0))


def chance_of_count(pairs: int, rate: float, holds: Callable[[int], bool]) -> float:
    """Return the probability of a condition on the number of pairs that have something."""
    counts, mass = _range(pairs, rate)
    return float(mass[[holds(count) for count in counts.tolist()]].sum())


def chance_by_task(tasks: Sequence[str], chances: Chances, holds: Callable[[float, float], bool]) -> float:
    """Return the share of simulated runs whose interval by task meets a condition.

    Args:
        tasks: Task of each pair. Losses and gains fall on the pairs of all tasks alike.
        holds: Called with both ends of the interval; a run without an interval does not meet it.
    """
    random, n = np.random.default_rng(2026), len(tasks)
    labels = np.unique(np.asarray(tasks), return_inverse=True)[1]
    met = 0
    for _ in range(DRAWS):
        draw = random.random(n)
        differences = (draw > 1 - chances.gain).astype(np.int64) - (draw < chances.loss)
        losses, gains = int((differences < 0).sum()), int((differences > 0).sum())
        interval = task_interval(differences, labels, paired_difference(losses, gains, n)).interval
        met += interval is not None and holds(interval.lower, interval.upper)
    return met / DRAWS


def _first(gains: Counts, trials: Counts, begins: Begins) -> Counts:
    """Return the least losses at which something holds, or one more than there can be."""
    low, high = np.full_like(gains, -1), trials + 1
    while (open_ := high - low > 1).any():
        middle = np.where(open_, (low + high) // 2, np.clip(low, 0, trials))
        held = begins(gains, middle)
        high = np.where(open_ & held, middle, high)
        low = np.where(open_ & ~held, middle, low)
    return high


def _range(pairs: int, rate: float) -> tuple[Counts, NDArray[np.float64]]:
    """Return the counts with a probability to speak of, and their probabilities."""
    from scipy import stats

    first, last = stats.binom.ppf(_REST, pairs, rate), stats.binom.isf(_REST, pairs, rate)
    counts = np.arange(max(0, int(first)), min(pairs, int(last)) + 1)
    return counts, stats.binom.pmf(counts, pairs, rate)
