"""Cluster bootstrap: intervals when cases share a task or an initial configuration."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.stats.blocks import IntervalByTask
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval
from pytest_libero_max.stats.measured import ends, number

REPLICATES = 10_000

LEAST_TASKS = 30
"""Least effective number of tasks, (sum of n)^2 / (sum of n^2), for an interval clustered by task."""

LEAST_CHANGED_TASKS = 15
"""Least number of tasks in which something differs, for the same: resampling needs something to vary."""

_CHUNK = 4_000_000
"""Weights held in memory at once."""


def cluster_bootstrap(
    values: ArrayLike,
    clusters: ArrayLike,
    *,
    strata: ArrayLike | None = None,
    pools: ArrayLike | None = None,
    replicates: int = REPLICATES,
    seed: int = 0,
    confidence: float = CONFIDENCE,
) -> Interval | None:
    """Percentile bootstrap of a mean that draws clusters with replacement and takes all cases of each.

    The mean of a resample is the weighted sum of the pooled means of its ``pools``, with the pools' shares
    of all cases as fixed weights, so that resampled clusters of unequal size do not shift the composition.
    A pool that a resample does not hold is left out of it, its weight spread over the others.

    To resample reference tasks jointly across sources, give tasks as clusters and sources as pools; to
    resample groups independently within each source, give sources as strata as well. Percentiles are taken
    by the inverse CDF. Reference: Davison & Hinkley (1997), Bootstrap Methods and their Application, 3.8.

    Args:
        values: (n,) integers, for paired differences -1, 0 and 1.
        clusters: (n,) label of the cluster of each case.
        strata: (n,) labels within which clusters are drawn independently; every cluster lies in one.
        pools: (n,) labels as above; by default all cases are one pool.
        seed: The same seed gives the same interval.

    Returns:
        The interval, None without cases.
    """
    numbers = np.asarray(values, dtype=np.float64)
    if not numbers.size:
        return None
    means = resampled_means(
        numbers[:, None], clusters, strata=strata, pools=pools, replicates=replicates, seed=seed
    )
    tail = (1 - confidence) / 2
    lower, upper = np.quantile(means[:, 0], [tail, 1 - tail], method="inverted_cdf")
    return Interval(float(lower), float(upper))


def resampled_means(
    columns: NDArray[np.float64],
    clusters: ArrayLike,
    *,
    strata: ArrayLike | None = None,
    pools: ArrayLike | None = None,
    replicates: int = REPLICATES,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Return the (replicates, k) means of :func:`cluster_bootstrap` for k columns of the same cases.

    Args:
        columns: (n, k) values, n >= 1.
    """
    n, width = columns.shape
    cluster_of, cluster_count = _codes(clusters)
    stratum_of, _ = _codes(np.zeros(n) if strata is None else strata)
    pool_of, pool_count = _codes(np.zeros(n) if pools is None else pools)

    cell = cluster_of * pool_count + pool_of
    cells = cluster_count * pool_count
    sums = np.stack([np.bincount(cell, weights=column, minlength=cells) for column in columns.T], axis=1)
    sums = sums.reshape(cluster_count, pool_count * width)
    sizes = np.bincount(cell, minlength=cells).reshape(cluster_count, pool_count)
    stratum_of_cluster = np.empty(cluster_count, dtype=np.int64)
    stratum_of_cluster[cluster_of] = stratum_of

    total = np.zeros((replicates, pool_count * width))
    cases = np.zeros((replicates, pool_count))
    strata_found = np.unique(stratum_of_cluster)
    if len(strata_found) == 1 and replicates * cluster_count <= _CHUNK:
        times = _cached_draws(seed, replicates, cluster_count)
        total, cases, strata_found = times @ sums, times @ sizes, strata_found[:0]
    generator = np.random.Generator(np.random.PCG64(seed))
    for stratum in strata_found:
        members = np.flatnonzero(stratum_of_cluster == stratum)
        for rows, times in _draws(generator, replicates, len(members)):
            total[rows] += times @ sums[members]
            cases[rows] += times @ sizes[members]
    weights = np.where(cases > 0, sizes.sum(axis=0) / n, 0.0)[:, :, None]
    by_pool = total.reshape(replicates, pool_count, width)
    means: NDArray[np.float64] = (weights * by_pool / np.maximum(cases, 1)[:, :, None]).sum(axis=1)
    means /= weights.sum(axis=1)
    return means


def task_interval(
    values: ArrayLike,
    tasks: ArrayLike,
    independent: Interval | None,
    of: ArrayLike | None = None,
    bounds: tuple[float, float] = (-1.0, 1.0),
) -> IntervalByTask:
    """Return the interval of a mean, or of a share, that takes the pairs of a task as one draw.

    It has no ends with fewer than :data:`LEAST_TASKS` effective tasks, or fewer than
    :data:`LEAST_CHANGED_TASKS` in which something differs.

    A bootstrap-t interval over resampled tasks: each resample is measured in its own standard error, that of
    a ratio by linearisation, and the quantiles of these are applied to the estimate. Reference: Davison and
    Hinkley (1997), Bootstrap Methods and their Application, 2.4 and 5.2. It is never narrower than the
    interval that takes all pairs as independent. ``reports/interval-coverage.md`` has its coverage.

    Args:
        values: (n,) integers: Dynamic - Base, or 1 for a success.
        tasks: (n,) labels.
        of: (n,) bool, the pairs that a share is of; None for all.
    """
    numbers, labels = np.asarray(values, dtype=np.float64), np.asarray(tasks)
    kept = np.ones(len(labels), dtype=np.bool_) if of is None else np.asarray(of, dtype=np.bool_)
    codes, count = _codes(labels[kept])
    sizes = np.bincount(codes, minlength=count).astype(np.float64)
    sums = np.bincount(codes, weights=numbers[kept], minlength=count).astype(np.float64)
    effective = float(sizes.sum() ** 2 / (sizes**2).sum()) if count else 0.0
    changed = int((np.bincount(codes, weights=numbers[kept] != 0, minlength=count) > 0).sum())
    if bounds[0] == 0:
        changed = min(changed, int((sums < sizes).sum()))
    interval = None
    if independent is not None and effective >= LEAST_TASKS and changed >= LEAST_CHANGED_TASKS:
        lower, upper = _studentized(sums, sizes)
        interval = Interval(
            max(bounds[0], min(lower, independent.lower)), min(bounds[1], max(upper, independent.upper))
        )
    lower_end, upper_end = ends(interval)
    return IntervalByTask(
        tasks=count,
        effective_tasks=number(effective) or 0.0,
        changed_tasks=changed,
        lower=lower_end,
        upper=upper_end,
    )


def _studentized(sums: NDArray[np.float64], sizes: NDArray[np.float64]) -> tuple[float, float]:
    """Bootstrap-t interval of sum(sums) / sum(sizes) over clusters; an end may be infinite.

    Args:
        sums: (clusters,) the total of each.
        sizes: (clusters,) its number of pairs.
    """
    clusters = len(sums)
    estimate = sums.sum() / sizes.sum()
    error = np.sqrt(((sums - estimate * sizes) ** 2).sum()) / sizes.sum()
    columns = np.stack([sums, sizes, sums * sums, sums * sizes, sizes * sizes], axis=1)
    if clusters * REPLICATES <= _CHUNK:
        drawn = _cached_draws(0, REPLICATES, clusters) @ columns
    else:
        generator = np.random.Generator(np.random.PCG64(0))
        drawn = np.concatenate([times @ columns for _, times in _draws(generator, REPLICATES, clusters)])
    total, cases, squares, products, weights = drawn.T
    means = total / cases
    errors = np.sqrt(np.maximum(squares - 2 * means * products + means * means * weights, 0.0)) / cases
    away = means - estimate
    with np.errstate(divide="ignore", invalid="ignore"):
        scores = np.where(np.abs(away) < 1e-12, 0.0, away / np.where(errors > 1e-12, errors, 0.0))
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(scores, [tail, 1 - tail], method="inverted_cdf").tolist()
    return float(estimate - high * error), float(estimate - low * error)


def _codes(labels: ArrayLike) -> tuple[NDArray[np.int64], int]:
    """Labels as numbers in the labels' own order, so that the order of cases does not matter."""
    distinct, codes = np.unique(np.asarray(labels), return_inverse=True)
    return codes.astype(np.int64), len(distinct)


@lru_cache(maxsize=4)
def _cached_draws(seed: int, replicates: int, clusters: int) -> NDArray[np.float64]:
    """All draws at once: the groups of a report mostly have the same tasks."""
    ((_, times),) = _draws(np.random.Generator(np.random.PCG64(seed)), replicates, clusters)
    return times


def _draws(
    generator: np.random.Generator, replicates: int, clusters: int
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Yield for each resample the draws of each cluster; in pieces of at most ``_CHUNK`` numbers."""
    step = max(1, _CHUNK // clusters)
    for start in range(0, replicates, step):
        rows = slice(start, min(start + step, replicates))
        times = generator.multinomial(clusters, np.full(clusters, 1 / clusters), size=rows.stop - start)
        yield rows, times.astype(np.float64)
