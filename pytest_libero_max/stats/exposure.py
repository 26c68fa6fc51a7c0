"""Stale-action exposure: execution of actions that a policy decided before the event."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.blocks import StaleActions
from pytest_libero_max.stats.measured import number

QUANTILES = (0.05, 0.25, 0.75, 0.95)


def expose(stale: ArrayLike, unanswered: int = 0) -> StaleActions:
    """Summarise stale actions, over the pairs in which a query followed the event.

    They measure feedback delay under the policy's own serving protocol, not whether a change was noticed. In
    an unanswered pair all remaining actions were stale, so their count is cut off by the end of the episode
    and would bias the mean.

    Args:
        stale: (n,) int of at least 0, actions executed between the event and the next query.

    Raises:
        ReportError: A count is negative.
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
    if counts.min() < 0:
        raise ReportError(f"stale_actions={int(counts.min())}, but a number of actions is at least 0.")
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
