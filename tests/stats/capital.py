"""Capital of a confidence sequence for many orders at once: a second way to the same numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def capital(numbers: NDArray[np.int64], total: int, least: int = 0) -> NDArray[np.float64]:
    """Capital against one sum after each number, for many orders at once.

    Args:
        numbers: (orders, population) numbers.
        total: The sum that is bet against, as too small.
        least: Smallest number that there can be.

    Returns:
        (orders, population) mean capital of the bets; infinite from where the sum is impossible.
    """
    steps = numbers - least
    left = numbers.shape[1] - np.arange(numbers.shape[1])
    rest = total - least * numbers.shape[1] - (np.cumsum(steps, axis=1) - steps)
    gain = np.where(rest > 0, steps * left / np.where(rest > 0, rest, 1) - 1, 0.0)
    mean = np.zeros(numbers.shape)
    for bet in (np.arange(20) + 0.5) / 20:
        mean += np.cumprod(1 + bet * gain, axis=1) / 20
    return np.where(np.maximum.accumulate((rest < 0) | (steps > rest), axis=1), math.inf, mean)
