"""Tests: exact McNemar in log space, and Holm's correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import special

from pytest_libero_max.stats.intervals import Interval


def mcnemar(losses: int, gains: int) -> float:
    """Return the decimal logarithm of the exact two-sided p-value of as many losses as gains in truth.

    Under the null the smaller count is Binomial(losses + gains, 1/2); the two-sided p-value is
    min(1, 2 P(X <= min)). It is summed in log space because eight thousand pairs make it smaller than the
    smallest double. Reference: Q. McNemar (1947), Psychometrika 12:153-157; A. Agresti, Categorical Data
    Analysis, 3rd ed., 11.1. Conservative for few discordant pairs: no p below 0.05 with fewer than six, and
    p = 1 without one, where nothing speaks against the null.
    """
    n, k = losses + gains, min(losses, gains)
    if 2 * k + 1 >= n:
        return 0.0
    logs = log_fair_coins(n)[: k + 1]  # the last one is the largest
    tail = logs[-1] + math.log(float(np.exp(logs - logs[-1]).sum()))
    return min(0.0, float(tail + math.log(2)) / math.log(10))


def log_fair_coins(n: int) -> NDArray[np.float64]:
    """Natural logarithms of the probabilities of 0 to n heads of n fair coins."""
    heads = np.arange(n + 1)
    logs: NDArray[np.float64] = (
        special.gammaln(n + 1) - special.gammaln(heads + 1) - special.gammaln(n - heads + 1) - n * math.log(2)
    )
    return logs


def holm(log10_p: Sequence[float | None]) -> tuple[float | None, ...]:
    """Holm's step-down adjustment of a family of p-values, all as decimal logarithms.

    The i-th smallest of m is multiplied by m - i (from 0), limited to 1, and never below a smaller one's.
    Reference: S. Holm (1979), Scand. J. Statist. 6:65-70. A None (a test that could not be made) stays None
    and does not count among the m.
    """
    order = sorted((p, i) for i, p in enumerate(log10_p) if p is not None)
    adjusted: list[float | None] = [None] * len(log10_p)
    running = -math.inf
    for rank, (p, index) in enumerate(order):
        running = max(running, min(0.0, p + math.log10(len(order) - rank)))
        adjusted[index] = running
    return tuple(adjusted)


Word = Literal["significant", "bounded null", "uninformative", "powerless"]

MARGIN = 0.05
"""Difference from which on it matters."""

WORDS: dict[Word, str] = {
    "significant": "a difference is shown",
    "bounded null": f"no difference is shown, and {100 * MARGIN:g} points or more are excluded",
    "uninformative": f"no difference is shown, and {100 * MARGIN:g} points or more are possible",
    "powerless": "too few pairs differ for any result to be significant",
}
"""The words with their meaning. The words are those of paired-eval; a bounded null is shown equivalence."""


def word_for(
    log10_p: float,
    interval: Interval,
    differing: int | None = None,
    *,
    comparisons: int = 1,
    margin: float = MARGIN,
    level: float = 0.05,
) -> Word:
    """Return the word for a difference.

    Args:
        log10_p: Decimal logarithm of the p-value, adjusted for all comparisons.
        interval: The interval of the difference, simultaneous with those of all comparisons.
        differing: Number of pairs in which the two differ, of which an exact McNemar test is made; None for
            another test, of which it is not known when it has no power.
    """
    if 10**log10_p < level:
        return "significant"
    if -margin < interval.lower and interval.upper < margin:
        return "bounded null"
    if differing is not None and 2.0 ** (1 - differing) * comparisons >= level:
        return "powerless"
    return "uninformative"
