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
from msgspec.structs import asdict
from numpy.typing import NDArray

from pytest_libero_max.lab.studies.camera.blocks import (
    ConditionContrast,
    ConditionRate,
    GroupInterval,
    Mean,
    SourceRate,
)
from pytest_libero_max.stats.bounded_mean import bounded_means
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS, resampled_means
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval, MeanChange, mean_change
from pytest_libero_max.stats.measured import BoolArray, bootstrap_of, ends, number, rate_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio

Differences = NDArray[np.int64]

TASK_REPLICATES = 50_000
"""Resamples of the reference tasks, as in the paper."""

GROUP_REPLICATES = 10_000
"""Resamples of configuration groups, of which there are about as many as cases."""


@dataclass(frozen=True, eq=False)
class Conditions:
    """Columns of cases of one length, one row a case."""

    successes: Mapping[str, BoolArray]
    """(n,) bool by condition, whether the task was completed."""
    source: NDArray[np.str_]
    """(n,) labels; strata."""
    task: NDArray[np.str_]
    """(n,) labels of the reference task, the same in all sources."""
    configuration: NDArray[np.str_]
    """(n,) labels of the configuration: cases of one differ in their event alone."""

    @property
    def sources(self) -> list[str]:
        """The sources there are, sorted."""
        return sorted(set(self.source.tolist()))

    def rate(self, condition: str) -> ConditionRate:
        """Success rate with the paper's source-stratified interval, and the same within each source."""
        successes = self.successes[condition].astype(np.int64)
        return ConditionRate(
            **asdict(_rate(successes, mean_change(successes, self.source))),
            by_source={
                name: _rate(some, mean_change(some))
                for name in self.sources
                for some in [successes[self.source == name]]
            },
        )

    def difference(self, first: str, second: str) -> Differences:
        """(n,) success of the first condition less that of the second: -1, 0 or 1."""
        return self.successes[first].astype(np.int64) - self.successes[second]

    def joint(self) -> dict[tuple[bool, ...], int]:
        """Numbers of cases by their outcomes in all conditions; the frequent ones first."""
        counts = Counter(zip(*(column.tolist() for column in self.successes.values()), strict=True))
        return dict(sorted(counts.items(), key=lambda item: (-item[1], [not flag for flag in item[0]])))


def contrasts(conditions: Conditions, pairs: Sequence[tuple[str, str]]) -> tuple[ConditionContrast, ...]:
    """For each pair, success in the first condition less success in the second."""
    columns = [conditions.difference(first, second) for first, second in pairs]
    return _contrasts(conditions, pairs, columns, _exact)


def contrasts_of_contrasts(
    conditions: Conditions,
    pairs: Sequence[tuple[tuple[str, str], tuple[str, str]]],
    names: Sequence[tuple[str, str]],
) -> tuple[ConditionContrast, ...]:
    """For each pair of contrasts, the first difference less the second, over the same cases, by name."""
    columns = [conditions.difference(*first) - conditions.difference(*second) for first, second in pairs]
    return _contrasts(conditions, names, columns, partial(bounded_means, largest=2))


def _exact(columns: Sequence[Differences]) -> list[Interval | None]:
    return paired_differences(
        [(int((column < 0).sum()), int((column > 0).sum()), len(column)) for column in columns]
    )


def _contrasts(
    conditions: Conditions,
    names: Sequence[tuple[str, str]],
    columns: Sequence[Differences],
    intervals_of: Callable[[Sequence[Differences]], list[Interval | None]],
) -> tuple[ConditionContrast, ...]:
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
        ConditionContrast(
            first=first,
            second=second,
            gains=int((column > 0).sum()),
            losses=int((column < 0).sum()),
            **asdict(_mean(interval, mean_change(column, source))),
            by_source={
                name: _mean(intervals[place], mean_change(column[source == name]))
                for name, intervals in within.items()
            },
            by_groups={name: intervals[place] for name, intervals in groups.items()},
        )
        for place, ((first, second), column, interval) in enumerate(
            zip(names, columns, intervals_of(columns), strict=True)
        )
    )


def _rate(successes: Differences, bootstrap: MeanChange | None) -> SourceRate:
    rate = rate_of(Ratio(int(successes.sum()), len(successes)))
    return SourceRate(**asdict(rate), bootstrap=bootstrap_of(bootstrap))


def _mean(interval: Interval | None, bootstrap: MeanChange | None) -> Mean:
    lower, upper = ends(interval)
    value = number(bootstrap.estimate if bootstrap else None)
    return Mean(value=value, lower=lower, upper=upper, bootstrap=bootstrap_of(bootstrap))


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
        means = resampled_means(values, groups, strata=strata, pools=pools, replicates=replicates)
        tail = (1 - CONFIDENCE) / 2
        lower, upper = np.quantile(means, [tail, 1 - tail], axis=0, method="inverted_cdf")
        for place, low, high in zip(decided, lower.tolist(), upper.tolist(), strict=True):
            intervals[place] = Interval(low, high)
    return [
        GroupInterval(
            groups=count,
            changed=number_changed,
            replicates=replicates,
            lower=ends(interval)[0],
            upper=ends(interval)[1],
        )
        for number_changed, interval in zip(changed, intervals, strict=True)
    ]
