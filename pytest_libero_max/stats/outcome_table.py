"""The 2x2 table of paired outcomes and the ratios that follow from its four counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.blocks import Outcomes

BoolArray = NDArray[np.bool_]

FLOOR_BASE_RATE = 0.2
"""Below this Base success rate a small change does not show a successful response (the paper's limit)."""


def tabulate(base: ArrayLike, dynamic: ArrayLike) -> Outcomes:
    """Count the four outcomes.

    Raises:
        ReportError: The arrays are not both one-dimensional and of one length.
    """
    first, second = boolean(base, "base"), boolean(dynamic, "dynamic")
    if first.shape != second.shape:
        raise ReportError(
            f"len(base)={len(first)} and len(dynamic)={len(second)}, but paired outcomes have one length. "
            "Select the same cases for both."
        )
    failed, gained, regressed, preserved = np.bincount(2 * first + second, minlength=4).tolist()
    return Outcomes(preserved, gained, regressed, failed)


def boolean(values: ArrayLike, name: str) -> BoolArray:
    """Return a one-dimensional bool array; refuses numbers, in which a NaN or a 2 could hide."""
    array = np.asarray(values)
    if array.size == 0:
        array = array.astype(np.bool_)
    if array.ndim != 1 or array.dtype != np.bool_:
        raise ReportError(
            f"{name} has shape {array.shape} and type {array.dtype}, but must be a list of true and false."
        )
    return array


def at_floor(outcomes: Outcomes) -> bool | None:
    """Return True if Base success leaves too little room to fall; None without pairs."""
    rate = outcomes.base.value
    return None if rate is None else rate < FLOOR_BASE_RATE
