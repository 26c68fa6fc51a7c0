"""Variance components of repeated pairs: between tasks, between cases of a task, between plays of a case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Components:
    """Estimated variances of one play of one case. An estimate below 0 is given as 0."""

    tasks: float | None
    """Between tasks; None with one task, or where ``cases`` is None."""
    cases: float | None
    """Between cases of a task; None where no task has two cases."""
    plays: float
    """Between plays of a case."""
    number: int
    """Number of cases."""
    repeats: int
    """Number of plays of each."""
    concentration: float
    """Sum of squared shares of the cases that tasks have: 1 / number of tasks if all have as many."""

    def standard_error(self, cases: int = 1, plays: int = 1) -> float | None:
        """Return the expected standard error of the mean, over tasks, cases and plays drawn again.

        Args:
            cases: Factor of the number of cases of each task.
            plays: Factor of the number of plays.
        """
        if self.tasks is None or self.cases is None:
            return None
        number, repeats = cases * self.number, plays * self.repeats
        variance = self.tasks * self.concentration + self.cases / number + self.plays / (number * repeats)
        return float(variance**0.5)


def variance_components(values: ArrayLike, tasks: ArrayLike) -> Components | None:
    """Estimate variance components by nested analysis of variance, with unequal numbers of cases a task.

    Mean squares are set equal to their expectations. Reference: S. R. Searle, G. Casella and C. E. McCulloch
    (1992), Variance Components, 3.6 and 5.1. None without cases, or with one play of each.

    Args:
        values: (cases, plays) numbers.
        tasks: (cases,) labels.
    """
    table = np.asarray(values, dtype=np.float64)
    if table.ndim != 2 or not len(table) or table.shape[1] < 2:
        return None
    number, repeats = table.shape
    means = table.mean(axis=1)
    _, codes = np.unique(np.asarray(tasks), return_inverse=True)
    sizes = np.bincount(codes)
    of_task = np.bincount(codes, weights=means) / sizes
    plays = float(((table - means[:, None]) ** 2).sum()) / (number * (repeats - 1))
    concentration = float((sizes**2).sum()) / number**2
    within, between = number - len(sizes), len(sizes) - 1
    cases = tasks_found = None
    if within:
        square = repeats * float(((means - of_task[codes]) ** 2).sum()) / within
        cases = max(0.0, (square - plays) / repeats)
        if between:
            each = number * (1 - concentration) / between
            top = repeats * float((sizes * (of_task - means.mean()) ** 2).sum()) / between
            tasks_found = max(0.0, (top - square) / (repeats * each))
    return Components(tasks_found, cases, plays, number, repeats, concentration)
