"""Power of the exact McNemar test: changes that some pairs can resolve, and pairs that a change needs."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import OptionError

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

    Raises:
        OptionError: The probabilities are not ones that a pair can have.
    """
    from scipy import stats

    _check(loss, gain)
    if pairs < 1:
        raise OptionError.seen("pairs", pairs, ", but a test needs at least one pair.")
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
    _check(loss, gain)
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


def _check(loss: float, gain: float) -> None:
    if not (0 <= loss <= 1 and 0 <= gain <= 1 and loss + gain <= 1 + 1e-12):
        raise OptionError.seen(
            "loss",
            loss,
            f" and gain={gain!r}, but must be probabilities of outcomes that exclude each other.",
        )
