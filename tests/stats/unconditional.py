"""Exact unconditional interval for a paired difference: the yardstick of ``reports/interval-coverage.md``.

It goes through every table of n pairs for every value of the nuisance parameter, which takes seconds for
hundreds of pairs and does not end for thousands. Reports and gates therefore use
:func:`~pytest_libero_max.stats.paired_difference.exact`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE, Interval
from pytest_libero_max.stats.paired_difference import FloatArray
from tests.stats.other_intervals import tango_score

NUISANCE = 101
"""Values of P(1, 0) over which the largest tail is looked for."""


def unconditional(losses: int, gains: int, pairs: int, confidence: float = CONFIDENCE) -> Interval:
    """All differences that neither one-sided test at half the level rejects.

    The tests order the tables by Tango's score and take the largest tail over the nuisance parameter, on a
    grid. Reference: I. S. F. Chan and Z. Zhang (1999), Biometrics 55:1202-1209, for two samples; H.-M. Hsueh,
    J.-P. Liu and J. J. Chen (2001), Biometrics 57:478-483, for pairs.
    """
    tail = (1 - confidence) / 2
    row = _row(losses, gains, pairs)

    def bound(sign: int) -> float:
        estimate = (gains - losses) / pairs
        inside, outside = estimate, float(sign)
        for _ in range(30):
            middle = (inside + outside) / 2
            p = tail_probabilities(pairs, middle)[0 if sign < 0 else 1][row]
            inside, outside = (middle, outside) if p > tail else (inside, middle)
        return outside

    return Interval(bound(-1), bound(1))


def tables(pairs: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Losses and gains of every possible table, in the order of :func:`tail_probabilities`."""
    losses, gains = np.meshgrid(np.arange(pairs + 1), np.arange(pairs + 1), indexing="ij")
    possible = losses + gains <= pairs
    return losses[possible], gains[possible]


@lru_cache(maxsize=64)
def tail_probabilities(pairs: int, difference: float) -> tuple[FloatArray, FloatArray]:
    """For every table: the largest probability of a score at least as high, and of one at least as low."""
    losses, gains = tables(pairs)
    score = tango_score(difference, losses, gains, pairs)
    # Scores that differ by rounding alone are equal.
    score = np.round(score, 9)
    order = np.argsort(score, kind="stable")
    ordered = score[order]
    first = np.searchsorted(ordered, ordered, side="left")
    last = np.searchsorted(ordered, ordered, side="right") - 1
    high, low = np.zeros(len(order)), np.zeros(len(order))
    coefficient = (
        special.gammaln(pairs + 1)
        - special.gammaln(losses + 1)
        - special.gammaln(gains + 1)
        - special.gammaln(pairs - losses - gains + 1)
    )[order]
    down, up = losses[order], gains[order]
    for loss in np.linspace(max(0.0, -difference), (1 - difference) / 2, NUISANCE):
        gain = loss + difference
        mass = np.exp(
            coefficient
            + special.xlogy(down, max(loss, 0.0))
            + special.xlogy(up, max(gain, 0.0))
            + special.xlogy(pairs - down - up, max(1 - loss - gain, 0.0))
        )
        np.maximum(high, np.cumsum(mass[::-1])[::-1][first], out=high)
        np.maximum(low, np.cumsum(mass)[last], out=low)
    back = np.empty(len(order), dtype=np.int64)
    back[order] = np.arange(len(order))
    return high[back], low[back]


def _row(losses: int, gains: int, pairs: int) -> int:
    """Where a table stands among :func:`tables`."""
    return losses * (pairs + 1) - losses * (losses - 1) // 2 + gains
