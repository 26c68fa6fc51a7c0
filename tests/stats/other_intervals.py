"""Other intervals for a paired difference, which ``reports/interval-coverage.md`` compares with ours."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from pytest_libero_max.stats.intervals import CONFIDENCE
from pytest_libero_max.stats.paired_difference import (
    PRECISION,
    Bounds,
    FloatArray,
    Products,
    chunks,
    together,
)


def tango(losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE) -> Bounds:
    """Score interval: all differences that the score test does not reject, found by bisection.

    Reference: T. Tango (1998), Statistics in Medicine 17:891-908. The variance is estimated under the
    difference tested, so that the width is positive without a discordant pair.
    """
    down, up, n = together(losses, gains, pairs)
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
    down, up, n = together(losses, gains, pairs)
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
    down, up, n = together(losses, gains, pairs)
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
    down, up, n = together(losses, gains, pairs)
    down, up, n = down + 0.5, up + 0.5, n + 2
    z = float(special.ndtri((1 + confidence) / 2))
    difference = (up - down) / n
    half = z * np.sqrt(np.maximum(up + down - (up - down) ** 2 / n, 0)) / n
    return np.maximum(difference - half, -1), np.minimum(difference + half, 1)


def _wilson(count: FloatArray, n: FloatArray, z: float) -> Bounds:
    rate = count / n
    middle, half = rate + z * z / (2 * n), z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def exact_holds(
    difference: float, losses: ArrayLike, gains: ArrayLike, pairs: ArrayLike, confidence: float = CONFIDENCE
) -> NDArray[np.bool_]:
    """Whether the interval of :func:`exact` holds a difference; cheaper than the interval itself."""
    down, up, n = together(losses, gains, pairs)
    held = np.empty(n.size, dtype=np.bool_)
    for rows in chunks(n.size):
        some = [counts.ravel()[rows] for counts in (up, down, n)]
        at = np.full(len(some[0]), difference)
        above = Products(some[0], some[1], some[2], at >= 0).exceed(at)
        below = Products(some[1], some[0], some[2], at <= 0).exceed(-at)
        held[rows] = np.minimum(above, below) >= (1 - confidence) / 2 - PRECISION
    return held.reshape(n.shape)
