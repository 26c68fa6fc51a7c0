"""Cluster bootstrap: intervals when cases share a task or an initial configuration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.intervals import CONFIDENCE

REPLICATES = 10_000

_CHUNK = 4_000_000
"""Draws held in memory at once."""


@dataclass(frozen=True)
class ClusterInterval:
    """A mean with an interval that resamples whole clusters of cases.

    Attributes:
        estimate: The case-weighted mean; clustering changes the interval only.
        clusters: How many clusters are resampled. With few (below about 30) the interval is too narrow.
        replicates: How many resamples.
        seed: Of the private generator; the same seed gives the same interval.
    """

    estimate: float
    lower: float
    upper: float
    clusters: int
    replicates: int
    seed: int


def cluster_bootstrap(
    values: ArrayLike,
    clusters: ArrayLike,
    *,
    strata: ArrayLike | None = None,
    pools: ArrayLike | None = None,
    replicates: int = REPLICATES,
    seed: int = 0,
    confidence: float = CONFIDENCE,
) -> ClusterInterval | None:
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
        replicates: How many resamples.
        seed: Of the private generator.
        confidence: Two-sided level.

    Returns:
        The interval, None without cases.

    Raises:
        ReportError: The arrays differ in length, or a cluster lies in two strata.
    """
    numbers = np.asarray(values, dtype=np.float64)
    n = len(numbers)
    if n == 0:
        return None
    cluster_of, cluster_count = _codes(clusters, n, "clusters")
    stratum_of, _ = _codes(np.zeros(n) if strata is None else strata, n, "strata")
    pool_of, pool_count = _codes(np.zeros(n) if pools is None else pools, n, "pools")

    cell = cluster_of * pool_count + pool_of
    shape = (cluster_count, pool_count)
    sums = np.bincount(cell, weights=numbers, minlength=cluster_count * pool_count).reshape(shape)
    sizes = np.bincount(cell, minlength=cluster_count * pool_count).reshape(shape)
    stratum_of_cluster = np.empty(cluster_count, dtype=np.int64)
    stratum_of_cluster[cluster_of] = stratum_of
    if (stratum_of_cluster[cluster_of] != stratum_of).any():
        raise ReportError(
            "A cluster lies in two strata, so it cannot be drawn within one. Split the cluster."
        )

    generator = np.random.Generator(np.random.PCG64(seed))
    total = np.zeros((replicates, pool_count))
    cases = np.zeros((replicates, pool_count))
    for stratum in np.unique(stratum_of_cluster):
        members = np.flatnonzero(stratum_of_cluster == stratum)
        for rows in _chunks(replicates, len(members)):
            drawn = members[generator.integers(len(members), size=(len(rows), len(members)))]
            for pool in range(pool_count):
                total[rows, pool] += sums[drawn, pool].sum(axis=1)
                cases[rows, pool] += sizes[drawn, pool].sum(axis=1)
    weights = np.where(cases > 0, sizes.sum(axis=0) / n, 0.0)
    means = (weights * total / np.maximum(cases, 1)).sum(axis=1) / weights.sum(axis=1)
    tail = (1 - confidence) / 2
    lower, upper = np.quantile(means, [tail, 1 - tail], method="inverted_cdf")
    return ClusterInterval(
        estimate=float(numbers.sum() / n),
        lower=float(lower),
        upper=float(upper),
        clusters=cluster_count,
        replicates=replicates,
        seed=seed,
    )


def _codes(labels: ArrayLike, n: int, name: str) -> tuple[NDArray[np.int64], int]:
    """Labels as numbers in the labels' own order, so that the order of cases does not matter."""
    array = np.asarray(labels)
    if array.shape != (n,):
        raise ReportError(f"{name} have shape {array.shape} for {n} values; give one label a case.")
    distinct, codes = np.unique(array, return_inverse=True)
    return codes.astype(np.int64), len(distinct)


def _chunks(replicates: int, width: int) -> list[NDArray[np.int64]]:
    """Row numbers in pieces of at most ``_CHUNK`` draws."""
    step = max(1, _CHUNK // width)
    return [np.arange(start, min(start + step, replicates)) for start in range(0, replicates, step)]
