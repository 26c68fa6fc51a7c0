"""The same cases under several conditions: rates, joint outcomes and contrasts, as in the paper's studies.

Intervals are pointwise: no family of contrasts is corrected for. Beside the exact ones are the paper's, which
keep the composition of sources (fixed strata), and some that resample groups of cases.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.bounded_mean import bounded_means
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS, resampled_means
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval, MeanChange, mean_change
from pytest_libero_max.stats.outcome_table import BoolArray, boolean
from pytest_libero_max.stats.paired_difference import paired_differences

Differences = NDArray[np.int64]

TASK_REPLICATES = 50_000
"""Resamples of the reference tasks, as in the paper."""

GROUP_REPLICATES = 10_000
"""Resamples of configuration groups, of which there are about as many as cases."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Columns of cases, one row a case.

    Raises:
        ReportError: The columns differ in length.
    """

    successes: Mapping[str, BoolArray]
    """(n,) bool by condition, whether the task was completed."""
    source: NDArray[np.str_]
    """(n,) labels; strata."""
    task: NDArray[np.str_]
    """(n,) labels of the reference task, the same in all sources."""
    configuration: NDArray[np.str_]
    """(n,) labels of the configuration: cases of one differ in their event alone."""

    def __post_init__(self) -> None:
        columns = [*self.successes.values(), self.source, self.task, self.configuration]
        lengths = sorted({len(column) for column in columns})
        if len(lengths) > 1:
            raise ReportError(f"Columns of conditions have the lengths {lengths}, but must have one.")

    @classmethod
    def of(
        cls,
        successes: Mapping[str, ArrayLike],
        source: ArrayLike,
        task: ArrayLike,
        configuration: ArrayLike,
    ) -> Conditions:
        """Build the columns from any sequences."""
        return cls(
            {name: boolean(values, name) for name, values in successes.items()},
            np.asarray(source, dtype=np.str_),
            np.asarray(task, dtype=np.str_),
            np.asarray(configuration, dtype=np.str_),
        )

    def __len__(self) -> int:
        return len(self.source)

    @property
    def sources(self) -> list[str]:
        """The sources there are, sorted."""
        return sorted(set(self.source.tolist()))

    def rate(self, condition: str) -> MeanChange | None:
        """Success rate with its exact source-stratified bootstrap interval; None without cases."""
        return mean_change(self.successes[condition].astype(np.int64), self.source)

    def difference(self, first: str, second: str) -> Differences:
        """(n,) success of the first condition less that of the second: -1, 0 or 1."""
        return self.successes[first].astype(np.int64) - self.successes[second]

    def joint(self) -> dict[tuple[bool, ...], int]:
        """Numbers of cases by their outcomes in all conditions; the frequent ones first."""
        counts = Counter(zip(*(column.tolist() for column in self.successes.values()), strict=True))
        return dict(sorted(counts.items(), key=lambda item: (-item[1], [not flag for flag in item[0]])))


@dataclass(frozen=True)
class GroupInterval:
    """An interval of a mean difference that resamples groups of cases."""

    groups: int
    changed: int
    """Number of them in which a case differs between the conditions."""
    replicates: int
    interval: Interval | None
    """None where it cannot be decided: with fewer than :data:`.clusters.LEAST_TASKS` groups, or fewer than
    :data:`.clusters.LEAST_CHANGED_TASKS` in which a case differs."""


@dataclass(frozen=True)
class MeanDifference:
    """A mean difference of success over the same cases."""

    interval: Interval | None
    """Of two conditions the melded exact one, of a difference of differences that of
    :func:`.bounded_mean.bounds`; None without cases."""
    bootstrap: MeanChange | None
    """The mean with the paper's interval, the exact source-stratified bootstrap; None without cases."""


@dataclass(frozen=True)
class Contrast(MeanDifference):
    """A mean difference of success over the same cases, also within sources and over groups of cases."""

    gains: int
    """Cases in which only the first condition succeeds (or the difference is above 0)."""
    losses: int
    """Cases in which only the second does (or it is below 0)."""
    by_source: Mapping[str, MeanDifference]
    """The same mean within each source."""
    by_groups: Mapping[str, GroupInterval]
    """Intervals over groups of cases, by what was resampled: ``reference_tasks`` jointly across the sources,
    ``source_tasks`` and ``configurations`` within each source."""


def contrasts(conditions: Conditions, pairs: Sequence[tuple[str, str]]) -> tuple[Contrast, ...]:
    """For each pair, success in the first condition less success in the second."""
    columns = [conditions.difference(first, second) for first, second in pairs]
    return _contrasts(conditions, columns, _exact)


def contrasts_of_contrasts(
    conditions: Conditions, pairs: Sequence[tuple[tuple[str, str], tuple[str, str]]]
) -> tuple[Contrast, ...]:
    """For each pair of contrasts, the first difference less the second, over the same cases."""
    columns = [conditions.difference(*first) - conditions.difference(*second) for first, second in pairs]
    return _contrasts(conditions, columns, partial(bounded_means, largest=2))


def _exact(columns: Sequence[Differences]) -> list[Interval | None]:
    return paired_differences(
        [(int((column < 0).sum()), int((column > 0).sum()), len(column)) for column in columns]
    )


def _contrasts(
    conditions: Conditions,
    columns: Sequence[Differences],
    intervals_of: Callable[[Sequence[Differences]], list[Interval | None]],
) -> tuple[Contrast, ...]:
    source, task = conditions.source, conditions.task
    source_task = np.char.add(np.char.add(source, "|"), task)
    groups = {
        "reference_tasks": _by_groups(columns, task, None, source, TASK_REPLICATES),
        "source_tasks": _by_groups(columns, source_task, source, source, TASK_REPLICATES),
        "configurations": _by_groups(columns, conditions.configuration, source, source, GROUP_REPLICATES),
    }
    within = {
        name: intervals_of([column[source == name] for column in columns]) for name in conditions.sources
    }
    return tuple(
        Contrast(
            interval=interval,
            bootstrap=mean_change(column, source),
            gains=int((column > 0).sum()),
            losses=int((column < 0).sum()),
            by_source={
                name: MeanDifference(intervals[place], mean_change(column[source == name]))
                for name, intervals in within.items()
            },
            by_groups={name: intervals[place] for name, intervals in groups.items()},
        )
        for place, (column, interval) in enumerate(zip(columns, intervals_of(columns), strict=True))
    )


def _by_groups(
    columns: Sequence[Differences],
    groups: NDArray[np.str_],
    strata: NDArray[np.str_] | None,
    pools: NDArray[np.str_],
    replicates: int,
) -> list[GroupInterval]:
    """Return the interval of each column; all are resampled together."""
    count = len(np.unique(groups))
    changed = [len(np.unique(groups[column != 0])) for column in columns]
    intervals: list[Interval | None] = [None] * len(columns)
    decided = [place for place, number in enumerate(changed) if number >= LEAST_CHANGED_TASKS]
    if count >= LEAST_TASKS and decided:
        values = np.stack([columns[place] for place in decided], axis=1).astype(np.float64)
        means, _ = resampled_means(values, groups, strata=strata, pools=pools, replicates=replicates)
        tail = (1 - CONFIDENCE) / 2
        lower, upper = np.quantile(means, [tail, 1 - tail], axis=0, method="inverted_cdf")
        for place, low, high in zip(decided, lower.tolist(), upper.tolist(), strict=True):
            intervals[place] = Interval(low, high)
    return [
        GroupInterval(count, number, replicates, interval)
        for number, interval in zip(changed, intervals, strict=True)
    ]
