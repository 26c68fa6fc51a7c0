"""Interval of a mean of values from a short list, for example differences of paired changes from -2 to 2."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE, Interval

FloatArray = NDArray[np.float64]

_DECIMALS = 9
"""Decimals of a reported bound, so that it is the same on every machine."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(200)
_ANGLES = (_NODES + 1) * np.pi / 4
_HEIGHTS = np.tan(_ANGLES)
"""Nodes of an integral over the positive reals, by the tangent."""
_LENGTHS = _WEIGHTS * np.pi / 4 / np.cos(_ANGLES) ** 2
_HALVINGS = 60
_CHUNK = 1024
"""Rows that are integrated at once."""


def bounded_means(
    samples: Sequence[ArrayLike], largest: int, confidence: float = CONFIDENCE
) -> list[Interval | None]:
    """Return the interval of :func:`bounds` for each sample, to nine decimals; None without a value.

    Args:
        samples: (n,) integers of each sample.
        largest: Largest value that was possible; the smallest one is its negative.
    """
    counts = np.array([_counts(sample, largest) for sample in samples]).reshape(-1, 2 * largest + 1)
    some = counts.sum(axis=1) > 0
    lower, upper = (np.round(ends, _DECIMALS).tolist() for ends in bounds(counts[some], confidence))
    intervals = iter([Interval(low, high) for low, high in zip(lower, upper, strict=True)])
    return [next(intervals) if known else None for known in some.tolist()]


def _counts(values: ArrayLike, largest: int) -> NDArray[np.int64]:
    return np.bincount(np.asarray(values, dtype=np.int64) + largest, minlength=2 * largest + 1)


def bounds(counts: ArrayLike, confidence: float = CONFIDENCE) -> tuple[FloatArray, FloatArray]:
    """Bounds of the mean of a variable whose values are -m, ..., m, from the counts of each value.

    The upper bound is a quantile of a weighted mean of the sample and one more value, m, whose weights are
    uniform on the simplex (Dirichlet); the lower bound takes -m. For two values this is Clopper and Pearson's
    interval, and without a difference from zero the upper bound is m (1 - ((1 - confidence) / 2) ** (1 / n)).
    That it covers for every distribution and n is a conjecture; ``reports/interval-coverage.md`` has what was
    computed. References: N. Gaffke (2005), Three test statistics for a nonparametric one-sided
    hypothesis on the mean of a nonnegative variable, Math. Methods Statist. 14:451-467; E. Learned-Miller and
    P. S. Thomas (2019), A New Confidence Interval for the Mean of a Bounded Random Variable,
    arXiv:1905.06208.

    Args:
        counts: (rows, 2 m + 1) numbers of each value, at least one in each row.

    Returns:
        (rows,) lower and upper bounds.
    """
    rows = np.asarray(counts, dtype=np.float64)
    tail = (1 - confidence) / 2
    return -_upper_bounds(rows[:, ::-1], tail), _upper_bounds(rows, tail)


def _upper_bounds(counts: FloatArray, tail: float) -> FloatArray:
    from scipy.optimize import elementwise

    most = (counts.shape[1] - 1) / 2
    values = np.linspace(-most, most, counts.shape[1])
    shapes = counts.copy()
    shapes[:, -1] += 1
    target = special.ndtri(tail)

    def excess(at: FloatArray, row: NDArray[np.intp]) -> FloatArray:
        chance = np.clip(exceed(shapes[row], values, at), 1e-300, 1 - 1e-16)
        beyond: FloatArray = special.ndtri(chance) - target
        return beyond

    upper = np.full(len(shapes), most)
    open_ = np.flatnonzero(shapes[:, :-1].sum(axis=1))  # the others are all at the largest value
    for start in range(0, len(open_), _CHUNK):
        row = open_[start : start + _CHUNK]
        means = shapes[row] @ values / shapes[row].sum(axis=1)
        bracket = (means, np.full(len(row), most - 1e-12))
        upper[row] = elementwise.find_root(excess, bracket, args=(row,), tolerances={"xatol": 1e-11}).x
    return upper


def exceed(shapes: FloatArray, values: FloatArray, limits: FloatArray) -> FloatArray:
    """Probabilities that a mean of values with Dirichlet weights exceeds a limit above its expectation.

    The mean exceeds the limit where a sum of independent gamma variables, each times its value less the
    limit, is above 0. With K the cumulant generating function of that sum, the probability is the integral of
    exp(K(z)) / z over a vertical line, which is put through the saddle point, where the integrand falls
    fastest. The relative error is below 0.002; the largest is that of thousands of equal values.

    Args:
        shapes: (rows, k) parameters of the weights; that of the last value is at least 1.
        values: (k,) the last one above each limit.
        limits: (rows,) numbers.
    """
    scale = values - limits[:, None]
    largest = scale[:, -1]
    low, high = np.zeros(len(limits)), 1 / largest
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        rises = (shapes * scale / (1 - scale * middle[:, None])).sum(axis=1) > 0
        low, high = np.where(rises, low, middle), np.where(rises, middle, high)
    # The integrand has a pole in 0: the line keeps a distance from it where the limit is near the mean.
    deviation = np.sqrt((shapes * scale**2).sum(axis=1))
    begin = np.maximum(low, 0.5 / np.maximum(deviation, largest))
    step = 1 / np.sqrt((shapes * (scale / (1 - scale * begin[:, None])) ** 2).sum(axis=1))
    z = begin[:, None] + 1j * step[:, None] * _HEIGHTS
    cumulant = np.zeros_like(z)
    for shape, times in zip(shapes.T, scale.T, strict=True):
        cumulant -= shape[:, None] * np.log(1 - times[:, None] * z)
    chance: FloatArray = ((np.exp(cumulant) / z).real @ _LENGTHS) * step / np.pi
    return chance
