"""Stale-action exposure: execution of actions that a policy decided before the event."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pytest_libero_max.errors import ReportError


@dataclass(frozen=True)
class Exposure:
    """Stale actions per pair, over the pairs in which a query followed the event.

    It measures feedback delay under the policy's own serving protocol, not whether a change was noticed.
    """

    pairs: int
    unanswered: int
    """Triggered pairs whose episode ended before another query. All their remaining actions were stale, so
    their count is cut off by the end of the episode and would bias the mean."""
    mean: float | None
    """Actions; None without a pair, like every number below."""
    median: float | None
    """Actions; the mean of the middle two for an even number of pairs."""
    quantiles: Mapping[str, int | None]
    """By probability (``0.05`` ... ``0.95``), inverse CDF: always a number that was observed."""
    histogram: Mapping[int, int]
    """Pairs by number of stale actions, ascending."""


QUANTILES = (0.05, 0.25, 0.75, 0.95)


def expose(stale: ArrayLike, unanswered: int = 0) -> Exposure:
    """Summarise stale actions.

    Args:
        stale: (n,) int of at least 0, actions executed between the event and the next query.
        unanswered: Triggered pairs without such a query.

    Raises:
        ReportError: A count is negative.
    """
    counts = np.asarray(stale, dtype=np.int64)
    if counts.size == 0:
        return Exposure(0, unanswered, None, None, {str(q): None for q in QUANTILES}, {})
    if counts.min() < 0:
        raise ReportError(f"stale_actions={int(counts.min())}, but a number of actions is at least 0.")
    levels = np.quantile(counts, QUANTILES, method="inverted_cdf")
    values, pairs = np.unique(counts, return_counts=True)
    return Exposure(
        pairs=len(counts),
        unanswered=unanswered,
        mean=float(counts.mean()),
        median=float(np.median(counts)),
        quantiles={str(q): int(level) for q, level in zip(QUANTILES, levels, strict=True)},
        histogram=dict(zip(values.tolist(), pairs.tolist(), strict=True)),
    )
