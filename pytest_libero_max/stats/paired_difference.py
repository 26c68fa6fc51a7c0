"""Intervals for a paired difference of proportions, from the counts of pairs that changed.

The functions take arrays of counts that broadcast against each other. The difference is Dynamic - Base,
estimated by ``(gains - losses) / pairs``: every pair is a loss (1, 0), a gain (0, 1) or alike.

Reports and gates use :func:`exact`. The others are what it was compared with in
``reports/interval-coverage.md``, which gives the reason for the choice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Bounds = tuple[FloatArray, FloatArray]
"""Lower and upper bounds, each of the common shape of the counts."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)
_FAR = 1e-13
"""Mass left out at each end of a distribution that is integrated over."""
_PRECISION = 1e-11
"""How closely a bound is found."""
_DECIMALS = 9
"""Of a reported bound, so that it is the same on every machine."""
_MOST_STEPS = 100
"""Of a search for a bound; it takes about nine."""
_CHUNK = 4096
"""Counts that are integrated at once."""


def paired_difference(losses: int, gains: int, pairs: int, confidence: float = CONFIDENCE) -> Interval | None:
    """The interval that reports and gates use, :func:`exact` to nine decimals; None without a pair.

    Raises:
        ReportError: The counts cannot be those of pairs.
    """
    return paired_differences([(losses, gains, pairs)], confidence)[0]


def paired_differences(
    counts: Sequence[tuple[int, int, int]], confidence: float = CONFIDENCE
) -> list[Interval | None]:
    """:func:`paired_difference` of several (losses, gains, pairs), which is faster than one at a time."""
    some = np.array([row for row in counts if row[2]], dtype=np.float64).reshape(-1, 3)
    lower, upper = (
        np.round(bound, _DECIMALS).tolist() for bound in exact(some[:, 0], some[:, 1], some[:, 2], confidence)
    )
    intervals = iter([Interval(low, high) for low, high in zip(lower, upper, strict=True)])
    return [next(intervals) if row[2] else None for row in counts]


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
        losses: Pairs that succeed in Base only.
        gains: Pairs that succeed in Dynamic only.
        pairs: All pairs, at least 1.
        confidence: Two-sided level.

    Raises:
        ReportError: The counts cannot be those of pairs.
    """
    down, up, n = _counts(losses, gains, pairs)
    # The lower bound is the upper one with losses and gains exchanged, negated.
    bounds = _upper_bounds(
        np.concatenate([down.ravel(), up.ravel()]),
        np.concatenate([up.ravel(), down.ravel()]),
        np.concatenate([n.ravel(), n.ravel()]),
        (1 - confidence) / 2,
    )
    return -bounds[: n.size].reshape(n.shape), bounds[n.size :].reshape(n.shape)


def exact_holds(
    difference: float, losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE
) -> NDArray[np.bool_]:
    """Whether the interval of :func:`exact` holds a difference; cheaper than the interval itself."""
    down, up, n = _counts(losses, gains, pairs)
    held = np.empty(n.size, dtype=np.bool_)
    for rows in _chunks(n.size):
        some = [counts.ravel()[rows] for counts in (up, down, n)]
        at = np.full(len(some[0]), difference)
        above = _Products(some[0], some[1], some[2], at >= 0).exceed(at)
        below = _Products(some[1], some[0], some[2], at <= 0).exceed(-at)
        held[rows] = np.minimum(above, below) >= (1 - confidence) / 2 - _PRECISION
    return held.reshape(n.shape)


def _upper_bounds(up: FloatArray, down: FloatArray, n: FloatArray, tail: float) -> FloatArray:
    """Where the probability to exceed falls to ``tail``."""
    positive = _beta_exceeds(up + 1, down, np.full_like(n, 0.5)) >= tail
    bounds = np.empty_like(n)
    for rows in _chunks(n.size):
        products = _Products(up[rows], down[rows], n[rows], positive[rows])
        bounds[rows] = _falling_roots(products, tail)
    return bounds


class _Products:
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

    def where(self, rows: NDArray[np.intp]) -> _Products:
        """Some of them."""
        some = object.__new__(_Products)
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


def _falling_roots(products: _Products, level: float) -> FloatArray:
    """Where falling probabilities meet ``level``.

    Inverse quadratic interpolation or bisection (T. R. Chandrupatla (1997), Advances in Engineering Software
    28:145-149) on the probit of the probability, which is nearly linear.
    """
    target = special.ndtri(level)

    def excess(products: _Products, at: FloatArray) -> FloatArray:
        found: FloatArray = special.ndtri(np.clip(products.exceed(at), 1e-300, 1 - 1e-16)) - target
        return found

    other = np.where(products.positive, 0.0, -1.0)
    last = other + 1
    f_other, f_last = excess(products, other), excess(products, last)
    roots = last.copy()  # where all of the probability is at the upper end
    rows = np.flatnonzero(f_last < 0)
    products = products.where(rows)
    other, last, f_other, f_last = other[rows], last[rows], f_other[rows], f_last[rows]
    third, f_third = other, f_other
    fraction = np.full(len(rows), 0.5)
    for _ in range(_MOST_STEPS):
        at = last + fraction * (other - last)
        found = excess(products, at)
        same = np.sign(found) == np.sign(f_last)
        third, f_third = np.where(same, last, other), np.where(same, f_last, f_other)
        other, f_other = np.where(same, other, last), np.where(same, f_other, f_last)
        last, f_last = at, found
        roots[rows] = last
        smallest = _PRECISION / np.maximum(np.abs(other - last), 1e-300)
        open_ = np.flatnonzero((smallest < 0.5) & (f_last != 0))
        if len(open_) == 0:
            break
        if len(open_) < len(rows):
            rows, products = rows[open_], products.where(open_)
            last, other, third = last[open_], other[open_], third[open_]
            f_last, f_other, f_third = f_last[open_], f_other[open_], f_third[open_]
            smallest = smallest[open_]
        along = _over(last - other, third - other)
        rise = _over(f_last - f_other, f_third - f_other)
        smooth = (rise**2 < along) & ((1 - rise) ** 2 < 1 - along)
        quadratic = _over(f_last, f_other - f_last) * _over(f_third, f_other - f_third)
        quadratic += (
            _over(third - last, other - last)
            * _over(f_last, f_third - f_last)
            * _over(f_other, f_third - f_other)
        )
        fraction = np.clip(np.where(smooth, quadratic, 0.5), smallest, 1 - smallest)
    return roots


def _over(one: FloatArray, other: FloatArray) -> FloatArray:
    return one / np.where(other == 0, 1, other)


def tango(losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE) -> Bounds:
    """Score interval: all differences that the score test does not reject, found by bisection.

    Reference: T. Tango (1998), Statistics in Medicine 17:891-908. The variance is estimated under the
    difference tested, so that the width is positive without a discordant pair.
    """
    down, up, n = _counts(losses, gains, pairs)
    z = float(special.ndtri((1 + confidence) / 2))
    bounds = []
    for sign in (1, -1):
        low, high = np.full(n.shape, -1.0), np.full(n.shape, 1.0)
        for _ in range(48):
            middle = (low + high) / 2
            beyond = tango_score(middle, down, up, n) > sign * z
            low, high = np.where(beyond, middle, low), np.where(beyond, high, middle)
        bounds.append((low + high) / 2)
    return bounds[0], bounds[1]


def tango_score(difference: ArrayLike, losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike) -> FloatArray:
    """Tango's score statistic of a difference: standard normal where it is true, falling as it grows."""
    down, up, n = _counts(losses, gains, pairs)
    delta = np.asarray(difference, dtype=np.float64)
    # The constrained estimate of P(0, 1) - max(delta, 0), from the quadratic 2n q^2 + b q + c = 0.
    b = -up - down + (2 * n - up + down) * delta
    c = -down * delta * (1 - delta)
    loss = np.maximum((np.sqrt(np.maximum(b * b - 8 * n * c, 0)) - b) / (4 * n), 0)
    variance = np.maximum(n * (2 * loss + delta * (1 - delta)), 0)
    distance = up - down - n * delta
    score = distance / np.sqrt(np.where(variance > 0, variance, 1))
    beyond = np.select([distance > 0, distance < 0], [np.inf, -np.inf], 0.0)
    result: FloatArray = np.where(variance > 0, score, beyond)
    return result


def newcombe(
    losses: ArrayLike,
    gains: ArrayLike,
    pairs: ArrayLike,
    preserved: ArrayLike,
    confidence: float = CONFIDENCE,
) -> Bounds:
    """Hybrid score interval: the Wilson intervals of both rates, joined with their correlation (method 10).

    Reference: R. G. Newcombe (1998), Statistics in Medicine 17:2635-2650. It alone needs ``preserved``, the
    pairs that succeed twice. The correlation is corrected for continuity, and 0 where a rate is 0 or 1.
    """
    down, up, n = _counts(losses, gains, pairs)
    both = np.asarray(preserved, dtype=np.float64)
    neither = n - both - down - up
    z = float(special.ndtri((1 + confidence) / 2))
    base, dynamic = both + down, both + up
    base_low, base_high = _wilson(base, n, z)
    low, high = _wilson(dynamic, n, z)
    margins = base * (n - base) * dynamic * (n - dynamic)
    cross = both * neither - down * up
    corrected = np.where(cross > n / 2, cross - n / 2, np.where(cross >= 0, 0.0, cross))
    phi = np.where(margins > 0, corrected / np.sqrt(np.where(margins > 0, margins, 1)), 0.0)
    difference = (up - down) / n

    def beyond(one: FloatArray, other: FloatArray) -> FloatArray:
        return np.sqrt(np.maximum(one**2 + other**2 - 2 * phi * one * other, 0))

    return (
        difference - beyond(dynamic / n - low, base_high - base / n),
        difference + beyond(high - dynamic / n, base / n - base_low),
    )


def agresti_min(
    losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE
) -> Bounds:
    """Wald interval after half a pair is added to each of the four outcomes, cut at -1 and 1.

    Reference: A. Agresti and Y. Min (2005), Statistics in Medicine 24:729-740.
    """
    down, up, n = _counts(losses, gains, pairs)
    down, up, n = down + 0.5, up + 0.5, n + 2
    z = float(special.ndtri((1 + confidence) / 2))
    difference = (up - down) / n
    half = z * np.sqrt(np.maximum(up + down - (up - down) ** 2 / n, 0)) / n
    return np.maximum(difference - half, -1), np.minimum(difference + half, 1)


def _wilson(count: FloatArray, n: FloatArray, z: float) -> Bounds:
    rate = count / n
    middle, half = rate + z * z / (2 * n), z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def _chunks(size: int) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, size, _CHUNK)]


def _counts(
    losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    down, up, n = np.broadcast_arrays(
        np.asarray(losses, dtype=np.float64),
        np.asarray(gains, dtype=np.float64),
        np.asarray(pairs, dtype=np.float64),
    )
    wrong = (down < 0) | (up < 0) | (n < 1) | (down + up > n)
    if wrong.any():
        at = int(np.flatnonzero(wrong)[0])
        raise ReportError(
            f"losses={down.flat[at]:g}, gains={up.flat[at]:g} of pairs={n.flat[at]:g}, but both are at least "
            "0 and together at most the pairs, of which there is at least one."
        )
    return down, up, n
