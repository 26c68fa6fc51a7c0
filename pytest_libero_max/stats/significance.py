"""Tests: exact McNemar in log space, and Holm's correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special


@dataclass(frozen=True)
class McNemar:
    """Exact two-sided McNemar test."""

    losses: int
    """Discordant pairs in which the first condition succeeds, (1, 0)."""
    gains: int
    """Discordant pairs in which the second does, (0, 1)."""
    log10_p: float
    """Decimal logarithm of the p-value; 0 (p = 1) without a discordant pair."""

    @property
    def p_value(self) -> float:
        """The p-value; 0.0 where it is below the smallest double, for which ``log10_p`` stays exact."""
        return float(10.0**self.log10_p)


def mcnemar(losses: int, gains: int) -> McNemar:
    """Test that both kinds of discordant pairs are equally likely.

    Under the null the smaller count is Binomial(losses + gains, 1/2); the two-sided p-value is
    min(1, 2 P(X <= min)). It is summed in log space because eight thousand pairs make it smaller than the
    smallest double. Reference: Q. McNemar (1947), Psychometrika 12:153-157; A. Agresti, Categorical Data
    Analysis, 3rd ed., 11.1. Conservative for few discordant pairs: no p below 0.05 with fewer than six, and
    p = 1 without one, where nothing speaks against the null.
    """
    n, k = losses + gains, min(losses, gains)
    if 2 * k + 1 >= n:
        return McNemar(losses, gains, 0.0)
    logs = log_fair_coins(n)[: k + 1]  # the last one is the largest
    tail = logs[-1] + math.log(float(np.exp(logs - logs[-1]).sum()))
    return McNemar(losses, gains, min(0.0, float(tail + math.log(2)) / math.log(10)))


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
