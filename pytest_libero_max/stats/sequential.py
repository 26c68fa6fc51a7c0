"""Sequential tests and intervals, valid however often the pairs measured so far are looked at.

Both are test martingales: capital that grows only by chance where the null holds, so that it ever reaches
1 / level with at most that probability (J. Ville (1939), Etude critique de la notion de collectif).
``reports/sequential.md`` shows error rates and the number of pairs that are saved, by simulation.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

_BETS = (np.arange(20) + 0.5)[:, None] / 20
"""Shares of the capital that are bet, a uniform mixture. Shape (20, 1)."""


def log_evidence_of_change(losses: int, gains: int) -> float:
    """Natural logarithm of the evidence that lost and gained pairs are not equally likely.

    The likelihood of the discordant pairs under a uniform mixture of all chances of a gain, over that under
    1/2: ``B(losses + 1, gains + 1) 2 ** (losses + gains)``. It is the sequential counterpart of the exact
    McNemar test: where each discordant pair is a loss or a gain with chance 1/2, whatever came before, the
    evidence ever reaches 1 / level with at most the probability ``level`` (H. Robbins (1970), Ann. Math.
    Statist. 41:1397-1409). The same holds for a fixed set of cases with as many losses as gains that is
    played in a random order: the kind that is ahead becomes the rarer one. 0 without a discordant pair.
    """
    return float(special.betaln(losses + 1, gains + 1)) + (losses + gains) * math.log(2)


class TotalSequence:
    """Confidence sequence for the sum of a finite set of whole numbers, seen one by one in a random order.

    For every possible sum a gambler bets that the numbers still to come are larger than that sum allows, and
    another one that they are smaller. What is still to come is known under each sum, so that the interval has
    no width after the last number. A sum is left out for good once the capital of one of the two has reached
    2 / level. Reference: I. Waudby-Smith and A. Ramdas (2024), J. R. Statist. Soc. B 86:1-27, section 5, with
    a uniform mixture of 20 bets in the place of a bet that follows the variance.

    Args:
        population: Number of all numbers, of which each is equally likely to be the next one.
        level: Probability that the sum is ever left out, between 0 and 1.
    """

    def __init__(self, population: int, level: float, least: int = 0, most: int = 1) -> None:
        self._offset = least * population, most * population
        self._sides = tuple(_LeastTotal(population, level / 2, most - least) for _ in range(2))
        self._ends = least, most

    def add(self, number: int) -> None:
        least, most = self._ends
        for side, steps in zip(self._sides, (number - least, most - number), strict=True):
            side.add(steps)

    @property
    def least(self) -> int:
        """Smallest sum that is not left out."""
        return self._sides[0].least + self._offset[0]

    @property
    def most(self) -> int:
        """Largest sum that is not left out."""
        return max(self.least, self._offset[1] - self._sides[1].least)


class _LeastTotal:
    """The lower side of a sequence, for numbers from 0 to ``width``.

    The capital is smaller for larger sums, so the sums that are left out are the smallest ones.
    """

    def __init__(self, population: int, level: float, width: int) -> None:
        self._left, self._width = population, width
        self._enough = math.log(len(_BETS) / level)
        self._rest = np.arange(width * population + 1)  # sum of the numbers to come, for each sum
        self._capital = np.zeros((len(_BETS), len(self._rest)))
        self.least = 0

    def add(self, number: int) -> None:
        possible = (self._rest >= number) & (self._rest - number <= self._width * (self._left - 1))
        # A number that a sum does not leave possible rules it out; where only 0 is left, 0 says nothing.
        mean = np.where(possible & (self._rest > 0), self._rest, 1) / self._left
        gain = np.where(possible & (self._rest > 0), number / mean - 1, 0.0)
        self._capital += np.log1p(_BETS * gain)
        self._rest = self._rest - number
        self._left -= 1
        last = min(len(self._rest) - 1, self._width * self._left - int(self._rest[0]))
        if last < 0:  # the sum was left out before, and what is left is too large: keep the largest possible
            self.least += last
            self._rest, last = self._rest[:1] + last, 0
        out = (np.logaddexp.reduce(self._capital, axis=0) >= self._enough) | (self._rest < 0)
        first = int(np.argmin(out[:last])) if not out[:last].all() else last
        self.least += first
        self._rest, self._capital = self._rest[first : last + 1], self._capital[:, first : last + 1]
