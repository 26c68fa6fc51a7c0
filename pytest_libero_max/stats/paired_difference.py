"""Intervals for a paired difference of proportions, from the counts of pairs that changed.

The functions take arrays of counts that broadcast against each other. The difference is Dynamic - Base,
estimated by ``(gains - losses) / pairs``: every pair is a loss (1, 0), a gain (0, 1) or alike.

Reports and gates use :func:`exact`. ``reports/interval-coverage.md`` compares it with other intervals and
gives the reason for the choice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE, Interval

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Bounds = tuple[FloatArray, FloatArray]
"""Lower and upper bounds, each of the common shape of the counts."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)
_FAR = 1e-13
"""Mass left out at each end of a distribution that is integrated over."""
PRECISION = 1e-11
"""Precision of a bound."""
_DECIMALS = 9
"""Decimals of a reported bound, so that it is the same on every machine."""
_CHUNK = 4096
"""Counts that are integrated at once."""
_MOST_KNOWN = 100_000
_KNOWN: dict[tuple[tuple[int, int, int], float], Interval] = {}
"""Intervals that this process has computed, by counts and level."""


def paired_difference(losses: int, gains: int, pairs: int, confidence: float = CONFIDENCE) -> Interval | None:
    """Return the interval that reports and gates use, :func:`exact` to nine decimals; None without a pair."""
    return paired_differences([(losses, gains, pairs)], confidence)[0]


def paired_differences(
    counts: Sequence[tuple[int, int, int]], confidence: float = CONFIDENCE
) -> list[Interval | None]:
    """:func:`paired_difference` of several (losses, gains, pairs), which is faster than one at a time.

    A report asks for the same counts of many groups, and gates compute it again: what is known is kept.
    """
    wanted = dict.fromkeys((row, confidence) for row in counts if row[2] and (row, confidence) not in _KNOWN)
    if len(_KNOWN) + len(wanted) > _MOST_KNOWN:
        _KNOWN.clear()
        wanted = dict.fromkeys((row, confidence) for row in counts if row[2])
    if wanted:
        _KNOWN.update(zip(wanted, _computed([row for row, _ in wanted], confidence), strict=True))
    return [_KNOWN[row, confidence] if row[2] else None for row in counts]


def _computed(counts: Sequence[tuple[int, int, int]], confidence: float) -> list[Interval]:
    some = np.array(counts, dtype=np.float64).reshape(-1, 3)
    lower, upper = (
        np.round(bound, _DECIMALS).tolist() for bound in exact(some[:, 0], some[:, 1], some[:, 2], confidence)
    )
    return [Interval(low, high) for low, high in zip(lower, upper, strict=True)]


def exact(losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE) -> Bounds:
    """Melded exact interval, which agrees with the exact McNemar test.

    The difference is ``t (2 b - 1)`` with ``t`` the probability of a discordant pair and ``b`` the
    probability that a discordant pair is a gain. The confidence distributions of Clopper and Pearson's bounds
    of both are combined: the upper bound is a quantile of the product of independent beta variables for the
    upper bound of ``b`` and for that bound of ``t`` which makes the product larger; the lower bound likewise.
    Reference: M. P. Fay and K. Lumbard (2021), Statistics in Medicine 40:1147-1159, who find both tails at
    most 2.5% for all n up to 100. A coverage of at least the nominal one is not proved for all n.

    Zero lies outside the interval exactly where the two-sided exact McNemar test has p < 1 - confidence. With
    losses only, the lower bound is Clopper and Pearson's for their proportion. Without a discordant pair the
    interval is [-u, u] with ``u = 1 - ((1 - confidence) / 2) ** (1 / pairs)``: 60.2 points for four pairs and
    0.05 points for eight thousand. The width is never zero.

    Args:
        pairs: All pairs, at least 1.
    """
    down, up, n = together(losses, gains, pairs)
    # The lower bound is the upper one with losses and gains exchanged, negated.
    bounds = _upper_bounds(
        np.concatenate([down.ravel(), up.ravel()]),
        np.concatenate([up.ravel(), down.ravel()]),
        np.concatenate([n.ravel(), n.ravel()]),
        (1 - confidence) / 2,
    )
    return -bounds[: n.size].reshape(n.shape), bounds[n.size :].reshape(n.shape)


def _upper_bounds(up: FloatArray, down: FloatArray, n: FloatArray, tail: float) -> FloatArray:
    """Values whose probability to be exceeded is ``tail``."""
    positive = _beta_exceeds(up + 1, down, np.full_like(n, 0.5)) >= tail
    bounds = np.empty_like(n)
    for rows in chunks(n.size):
        products = Products(up[rows], down[rows], n[rows], positive[rows])
        bounds[rows] = _falling_roots(products, tail)
    return bounds


class Products:
    """The random variables ``T (2 B - 1)`` of several counts, each on one side of zero.

    ``B`` is Beta(up + 1, down). With m = up + down discordant pairs, ``T`` is Beta(m + 1, n - m) for the
    positive products and Beta(m, n - m + 1) for the negative ones, which makes either larger. A beta variable
    whose first parameter is 0 is 0, one whose second is 0 is 1.
    """

    def __init__(self, up: FloatArray, down: FloatArray, n: FloatArray, positive: BoolArray) -> None:
        first = up + down + positive
        second = n - up - down + ~positive
        self.up, self.down, self.positive = up, down, positive
        self.zero, self.one = first == 0, second == 0
        self.first, self.second = np.maximum(first, 1), np.maximum(second, 1)
        self.least = special.betaincinv(self.first, self.second, _FAR)
        self.most = special.betainccinv(self.first, self.second, _FAR)
        self.norm = special.betaln(self.first, self.second)

    def where(self, rows: NDArray[np.intp]) -> Products:
        some = object.__new__(Products)
        some.__dict__.update({name: values[rows] for name, values in vars(self).items()})
        return some

    def exceed(self, value: FloatArray) -> FloatArray:
        """Probabilities of at least ``value``, each on the side of zero that was named.

        P(B >= (1 + value / t) / 2) is integrated over the density of T by Gauss-Legendre quadrature. Where
        T < abs(value), it is 0 for a positive value and 1 for a negative one.
        """
        begin = np.clip(np.abs(value), self.least, self.most)
        half = ((self.most - begin) / 2)[:, None]
        t = begin[:, None] + half * (1 + _NODES)
        density = np.exp(
            special.xlogy(self.first[:, None] - 1, t)
            + special.xlog1py(self.second[:, None] - 1, -t)
            - self.norm[:, None]
        )
        share = _beta_exceeds(self.up[:, None] + 1, self.down[:, None], (1 + value[:, None] / t) / 2)
        chance = (half * density * share) @ _WEIGHTS
        chance += np.where(self.positive, 0.0, special.betainc(self.first, self.second, begin))
        if self.one.any():
            chance = np.where(self.one, _beta_exceeds(self.up + 1, self.down, (1 + value) / 2), chance)
        result: FloatArray = np.where(self.zero, 1.0 * (value <= 0), chance)
        return result


def _beta_exceeds(first: FloatArray, second: FloatArray, value: FloatArray) -> FloatArray:
    """P(B >= value) for B ~ Beta(first, second); B is 1 where second is 0."""
    chance = special.betaincc(first, np.maximum(second, 1), np.clip(value, 0, 1))
    result: FloatArray = np.where(second == 0, 1.0 * (value <= 1), chance)
    return result


def _falling_roots(products: Products, level: float) -> FloatArray:
    """Values at which falling probabilities meet ``level``, found on the nearly linear probit scale."""
    from scipy.optimize import elementwise

    target = special.ndtri(level)

    def excess(at: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        solution: FloatArray = (
            special.ndtri(np.clip(products.where(rows).exceed(at), 1e-300, 1 - 1e-16)) - target
        )
        return solution

    low = np.where(products.positive, 0.0, -1.0)
    roots = low + 1  # where all of the probability is at the upper end
    rows = np.flatnonzero(excess(roots, np.arange(roots.size)) < 0)
    if rows.size:
        bracket = (low[rows], roots[rows])
        solution = elementwise.find_root(excess, bracket, args=(rows,), tolerances={"xatol": PRECISION})
        roots[rows] = solution.x
    return roots


def chunks(size: int) -> list[slice]:
    """Return slices of at most 4,096 rows, which bound the memory of an integration."""
    return [slice(start, start + _CHUNK) for start in range(0, size, _CHUNK)]


def together(
    losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return losses, gains and pairs as float arrays of a common shape."""
    down, up, n = np.broadcast_arrays(
        *(np.asarray(counts, dtype=np.float64) for counts in (losses, gains, pairs))
    )
    return down, up, n
