"""One set of pairs measured: outcomes, intervals, test, coverage and stale actions together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec.structs import asdict
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.stats.blocks import (
    Bootstraps,
    Change,
    GivenResponse,
    Outcomes,
    RatesByTask,
    Result,
    StaleActions,
    TaskInterval,
)
from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.intervals import Interval, clopper_pearson, mean_change
from pytest_libero_max.stats.measured import (
    BoolArray,
    at_floor,
    bootstrap_of,
    mcnemar_of,
    mean_difference_of,
    number,
    rate_of,
    ratio_of,
    tabulate,
)
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio

QUANTILES = (0.05, 0.25, 0.75, 0.95)


def expose(stale: ArrayLike, unanswered: int = 0) -> StaleActions:
    """Summarise stale actions, over the pairs in which a query followed the event.

    They measure feedback delay under the policy's own serving protocol, not whether a change was noticed. In
    an unanswered pair all remaining actions were stale, so their count is cut off by the end of the episode
    and would bias the mean.

    Args:
        stale: (n,) int of at least 0, actions executed between the event and the next query.
    """
    counts = np.asarray(stale, dtype=np.int64)
    if counts.size == 0:
        return StaleActions(
            pairs=0,
            unanswered=unanswered,
            mean=None,
            median=None,
            quantiles={str(q): None for q in QUANTILES},
            histogram={},
        )
    levels = np.quantile(counts, QUANTILES, method="inverted_cdf")
    values, pairs = np.unique(counts, return_counts=True)
    return StaleActions(
        pairs=len(counts),
        unanswered=unanswered,
        mean=number(float(counts.mean())),
        median=number(float(np.median(counts))),
        quantiles={str(q): int(level) for q, level in zip(QUANTILES, levels, strict=True)},
        histogram=dict(zip(map(str, values.tolist()), pairs.tolist(), strict=True)),
    )


_SHARE = (0.0, 1.0)

Labels = NDArray[np.str_] | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Pairs:
    """Columns of measured pairs, one row a pair."""

    base: BoolArray
    """(n,) bool, Base completed the task."""
    dynamic: BoolArray
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
        return cls(
            np.asarray(base, dtype=np.bool_),
            np.asarray(dynamic, dtype=np.bool_),
            np.asarray(triggered, dtype=np.bool_),
            np.asarray(responded, dtype=np.bool_),
            np.asarray(stale, dtype=np.int64),
            np.asarray(source, dtype=np.str_),
            np.asarray(task, dtype=np.str_),
        )

    def numbered(self) -> Pairs:
        """Return the same pairs with numbers for labels, in the labels' order, for faster statistics."""
        source, task = (np.unique(labels, return_inverse=True)[1] for labels in (self.source, self.task))
        return replace(self, source=source.astype(np.int64), task=task.astype(np.int64))

    def at(self, places: Sequence[int] | BoolArray) -> Pairs:
        """Return some of the pairs, by their places or by a mask."""
        return Pairs(**{name: column[np.asarray(places)] for name, column in vars(self).items()})


def measure(pairs: Pairs, planned: int | None = None) -> Result:
    """Compute the result of a set of pairs; every value without a denominator is None."""
    return measure_groups([pairs], None if planned is None else [planned])[0]


def measure_groups(groups: Sequence[Pairs], planned: Sequence[int] | None = None) -> list[Result]:
    """:func:`measure` for several sets of pairs, whose exact intervals are computed together."""
    outcomes = [tabulate(pairs.base, pairs.dynamic) for pairs in groups]
    changes = paired_differences(
        [(cell.regression, cell.change_associated_success, cell.total) for cell in outcomes]
    )
    counts = [len(pairs) for pairs in groups] if planned is None else planned
    return [_result(*parts) for parts in zip(groups, outcomes, changes, counts, strict=True)]


def _result(pairs: Pairs, outcomes: Outcomes, change: Interval | None, planned: int) -> Result:
    triggered = Ratio(int(pairs.triggered.sum()), len(pairs))
    responded = Ratio(int(pairs.responded.sum()), len(pairs))
    given = tabulate(pairs.base[pairs.responded], pairs.dynamic[pairs.responded])
    return Result(
        planned=planned,
        played=outcomes.total,
        base_success=rate_of(outcomes.base),
        dynamic_success=rate_of(outcomes.dynamic),
        paired_change=_change(pairs, outcomes, change),
        by_task=RatesByTask(
            base_success=_rate_by_task(pairs, pairs.base, outcomes.base),
            dynamic_success=_rate_by_task(pairs, pairs.dynamic, outcomes.dynamic),
            conditional_regression=_rate_by_task(
                pairs, pairs.base & ~pairs.dynamic, outcomes.conditional_regression, of=pairs.base
            ),
        ),
        outcomes=outcomes,
        conditional_regression=rate_of(outcomes.conditional_regression),
        retained=ratio_of(outcomes.retained),
        mcnemar=mcnemar_of(outcomes),
        trigger_coverage=rate_of(triggered),
        response_coverage=rate_of(responded),
        stale_actions=expose(pairs.stale[pairs.responded], unanswered=triggered.count - responded.count),
        given_response=GivenResponse(
            base_success=ratio_of(given.base),
            dynamic_success=ratio_of(given.dynamic),
            paired_change=ratio_of(given.change),
            outcomes=given,
        ),
        floor=at_floor(outcomes),
    )


def _change(pairs: Pairs, outcomes: Outcomes, interval: Interval | None) -> Change:
    """Return the paired change: exact interval, the one clustered by task, and the paper's two bootstraps."""
    differences = pairs.dynamic.astype(np.int64) - pairs.base
    change = mean_difference_of(outcomes.change, interval)
    return Change(
        **asdict(change),
        by_task=TaskInterval(**asdict(task_interval(differences, pairs.task, interval)), value=change.value),
        bootstrap=Bootstraps(
            **asdict(bootstrap_of(mean_change(differences))),
            by_source=bootstrap_of(mean_change(differences, pairs.source)),
        ),
    )


def _rate_by_task(pairs: Pairs, hits: BoolArray, rate: Ratio, of: BoolArray | None = None) -> TaskInterval:
    interval = task_interval(hits, pairs.task, clopper_pearson(rate), of=of, bounds=_SHARE)
    return TaskInterval(**asdict(interval), value=number(rate.value))
