"""The 2x2 table of paired outcomes and the ratios that follow from its four counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ReportError

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Ratio:
    """A count over a count; the value is None where the denominator is zero."""

    count: int
    of: int

    @property
    def value(self) -> float | None:
        return self.count / self.of if self.of else None


@dataclass(frozen=True)
class Outcomes:
    """Number of pairs that ended in each of the four ways, written (Base, Dynamic)."""

    preserved_success: int
    """(1, 1)."""
    change_associated_success: int
    """(0, 1)."""
    regression: int
    """(1, 0)."""
    persistent_failure: int
    """(0, 0)."""

    @property
    def total(self) -> int:
        return (
            self.preserved_success
            + self.change_associated_success
            + self.regression
            + self.persistent_failure
        )

    @property
    def base(self) -> Ratio:
        """Base success rate over all pairs."""
        return Ratio(self.preserved_success + self.regression, self.total)

    @property
    def dynamic(self) -> Ratio:
        """Dynamic success rate over all pairs."""
        return Ratio(self.preserved_success + self.change_associated_success, self.total)

    @property
    def change(self) -> Ratio:
        """Paired change, the mean of (Dynamic - Base): (gained - regressed) / N. Negative for a loss."""
        return Ratio(self.change_associated_success - self.regression, self.total)

    @property
    def conditional_regression(self) -> Ratio:
        """Share of the Base successes that fail in Dynamic."""
        return Ratio(self.regression, self.base.count)

    @property
    def retained(self) -> Ratio:
        """Dynamic successes over Base successes, newly solved cases included; may exceed 1."""
        return Ratio(self.dynamic.count, self.base.count)


def tabulate(base: ArrayLike, dynamic: ArrayLike) -> Outcomes:
    """Count the four outcomes.

    Args:
        base: (n,) bool, whether Base completed the task.
        dynamic: (n,) bool, the same cases in Dynamic.

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
    """Return a one-dimensional bool array; refuses numbers, in which a NaN or a 2 could hide.

    Raises:
        ReportError: It is something else.
    """
    array = np.asarray(values)
    if array.size == 0:
        array = array.astype(np.bool_)
    if array.ndim != 1 or array.dtype != np.bool_:
        raise ReportError(
            f"{name} has shape {array.shape} and type {array.dtype}, but must be a list of true and false."
        )
    return array
