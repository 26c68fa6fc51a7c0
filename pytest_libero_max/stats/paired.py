"""One set of pairs measured: outcomes, intervals, test, coverage and stale actions together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.clusters import TaskInterval, task_interval
from pytest_libero_max.stats.exposure import Exposure, expose
from pytest_libero_max.stats.intervals import Interval, MeanChange, clopper_pearson, mean_change
from pytest_libero_max.stats.outcome_table import BoolArray, Outcomes, Ratio, boolean, tabulate
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.significance import McNemar, mcnemar

_SHARE = (0.0, 1.0)

Labels = NDArray[np.str_] | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Pairs:
    """Columns of measured pairs, one row a pair.

    Raises:
        ReportError: The columns differ in length or contradict each other.
    """

    base: BoolArray
    """(n,) bool, Base completed the task."""
    dynamic: BoolArray
    """(n,) bool, Dynamic did."""
    triggered: BoolArray
    """(n,) bool, the event fired."""
    responded: BoolArray
    """(n,) bool, a query followed it."""
    stale: NDArray[np.int64]
    """(n,) int, stale actions; -1 where the event never fired."""
    source: Labels
    """(n,) labels; strata of the fixed-composition bootstrap."""
    task: Labels
    """(n,) labels; pairs of one task are not independent."""

    def __post_init__(self) -> None:
        lengths = {name: len(column) for name, column in vars(self).items()}
        if len(set(lengths.values())) > 1:
            raise ReportError(f"Columns of pairs have the lengths {lengths}, but must have one.")
        if (self.responded & ~self.triggered).any():
            raise ReportError("A pair has a query after an event that never fired; its record is damaged.")
        if ((self.stale >= 0) != self.triggered).any():
            raise ReportError(
                "Stale actions must be counted in exactly the triggered pairs; a record is damaged."
            )

    def __len__(self) -> int:
        return len(self.base)

    @classmethod
    def of(
        cls,
        base: ArrayLike,
        dynamic: ArrayLike,
        triggered: ArrayLike,
        responded: ArrayLike,
        stale: ArrayLike,
        source: ArrayLike,
        task: ArrayLike,
    ) -> Pairs:
        """Build the columns from any sequences."""
        return cls(
            boolean(base, "base"),
            boolean(dynamic, "dynamic"),
            boolean(triggered, "triggered"),
            boolean(responded, "responded"),
            np.asarray(stale, dtype=np.int64),
            np.asarray(source, dtype=np.str_),
            np.asarray(task, dtype=np.str_),
        )

    def numbered(self) -> Pairs:
        """Return the same pairs with numbers for labels, in the labels' order, for faster statistics."""
        source, task = (np.unique(labels, return_inverse=True)[1] for labels in (self.source, self.task))
        return replace(self, source=source.astype(np.int64), task=task.astype(np.int64))

    def at(self, places: Sequence[int]) -> Pairs:
        """Return the pairs at these places, in this order."""
        return Pairs(
            **{name: column[np.asarray(places, dtype=np.intp)] for name, column in vars(self).items()}
        )

    def where(self, mask: BoolArray) -> Pairs:
        """Return the pairs for which ``mask`` is true."""
        return Pairs(**{name: column[mask] for name, column in vars(self).items()})


@dataclass(frozen=True)
class PairedResult:
    """Everything reported about one set of pairs; rates are over all of them unless said otherwise."""

    outcomes: Outcomes
    """The four counts, with all ratios that follow from them."""
    change: Interval | None
    """Interval of the paired change for independent pairs: exact, and never without a width."""
    change_by_task: TaskInterval
    """The same for statements about other tasks."""
    base_by_task: TaskInterval
    """Interval of the Base success rate for statements about other tasks."""
    dynamic_by_task: TaskInterval
    """The same of the Dynamic success rate."""
    lost_by_task: TaskInterval
    """The same of the share of Base successes lost."""
    bootstrap: MeanChange | None
    """The paper's interval of the paired change, resampling all pairs alike."""
    bootstrap_by_source: MeanChange | None
    """The paper's interval, resampling within each source."""
    mcnemar: McNemar
    """Exact test of (1, 0) against (0, 1)."""
    trigger_coverage: Ratio
    """Pairs whose event fired, of all."""
    response_coverage: Ratio
    """Pairs with a query after the event, of all."""
    exposure: Exposure
    given_response: Outcomes
    """The four counts among the pairs with a query after the event: a diagnostic that must never be mixed
    with the full-denominator outcomes."""


def measure(pairs: Pairs) -> PairedResult:
    """Compute the result of a set of pairs; every value without a denominator is None."""
    return measure_groups([pairs])[0]


def measure_groups(groups: Sequence[Pairs]) -> list[PairedResult]:
    """:func:`measure` for several sets of pairs, whose exact intervals are computed together."""
    outcomes = [tabulate(pairs.base, pairs.dynamic) for pairs in groups]
    changes = paired_differences(
        [(cell.regression, cell.change_associated_success, cell.total) for cell in outcomes]
    )
    return [_result(*parts) for parts in zip(groups, outcomes, changes, strict=True)]


def _result(pairs: Pairs, outcomes: Outcomes, change: Interval | None) -> PairedResult:
    differences = pairs.dynamic.astype(np.int64) - pairs.base
    triggered = Ratio(int(pairs.triggered.sum()), len(pairs))
    responded = Ratio(int(pairs.responded.sum()), len(pairs))
    base, dynamic, lost = map(
        clopper_pearson, (outcomes.base, outcomes.dynamic, outcomes.conditional_regression)
    )
    return PairedResult(
        outcomes=outcomes,
        change=change,
        change_by_task=task_interval(differences, pairs.task, change),
        base_by_task=task_interval(pairs.base, pairs.task, base, bounds=_SHARE),
        dynamic_by_task=task_interval(pairs.dynamic, pairs.task, dynamic, bounds=_SHARE),
        lost_by_task=task_interval(
            pairs.base & ~pairs.dynamic, pairs.task, lost, of=pairs.base, bounds=_SHARE
        ),
        bootstrap=mean_change(differences),
        bootstrap_by_source=mean_change(differences, pairs.source),
        mcnemar=mcnemar(outcomes.regression, outcomes.change_associated_success),
        trigger_coverage=triggered,
        response_coverage=responded,
        exposure=expose(pairs.stale[pairs.responded], unanswered=triggered.count - responded.count),
        given_response=tabulate(pairs.base[pairs.responded], pairs.dynamic[pairs.responded]),
    )
