"""How often the 95% intervals hold the truth: the numbers behind ``reports/interval-coverage.md``.

``python -m pytest_libero_max.report.interval_coverage`` prints that file.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from pytest_libero_max.stats.intervals import MeanChange, mean_change, wilson
from pytest_libero_max.stats.outcomes import Ratio

SIZES = (30, 100, 800)
RATES = (0.02, 0.05, 0.1, 0.3, 0.5, 0.8, 0.95)
CHANGES = ((0.01, 0.01), (0.05, 0.0), (0.05, 0.02), (0.1, 0.1), (0.2, 0.03), (0.4, 0.05), (0.7, 0.01))
"""Probabilities of a regression and of a gain."""

_DRAWS = 4000
_ENUMERATED = 100
"""Up to this size every possible result is gone through; beyond it results are drawn."""


def wilson_coverage(n: int, rate: float) -> float:
    """Exact probability that the Wilson interval of ``n`` trials holds the true ``rate``."""
    counts = np.arange(n + 1)
    held = np.array([_holds_rate(count, n, rate) for count in counts.tolist()])
    return float(stats.binom.pmf(counts, n, rate)[held].sum())


def bootstrap_coverage(n: int, loss: float, gain: float, seed: int = 0) -> float:
    """Probability that the bootstrap interval of the paired change holds the truth, ``gain - loss``.

    Exact up to a hundred pairs, beyond that from 4,000 seeded draws (standard error at most 0.004).
    """
    rates = [loss, gain, 1 - loss - gain]
    if n <= _ENUMERATED:
        results = np.array([(a, b, n - a - b) for a in range(n + 1) for b in range(n + 1 - a)])
        weights = stats.multinomial.pmf(results, n, rates)
    else:
        results = np.random.Generator(np.random.PCG64(seed)).multinomial(n, rates, size=_DRAWS)
        weights = np.full(_DRAWS, 1 / _DRAWS)
    likely: NDArray[np.bool_] = weights > 1e-12
    held = [_holds_change(n, a, b, gain - loss) for a, b, _ in results[likely].tolist()]
    return float(weights[likely][held].sum())


def markdown() -> str:
    """The report, as Markdown."""
    return "\n".join(_lines()) + "\n"


def _lines() -> Iterator[str]:
    sizes = " | ".join(f"n = {n}" for n in SIZES)
    yield from (
        "# How often the intervals hold the truth",
        "",
        "Nominal: 95%. Values below 93% are marked with `!`.",
        "",
        "## Wilson interval of a success rate (exact)",
        "",
        f"| True rate | {sizes} |",
        "| --- |" + " --- |" * len(SIZES),
    )
    for rate in RATES:
        yield _row(f"{rate:g}", [wilson_coverage(n, rate) for n in SIZES])
    yield from (
        "",
        "## Exact paired bootstrap of the change",
        "",
        "Exact for n = 30 and n = 100; 4,000 seeded draws for n = 800.",
        "",
        f"| P(1,0), P(0,1) | {sizes} |",
        "| --- |" + " --- |" * len(SIZES),
    )
    for loss, gain in CHANGES:
        yield _row(f"{loss:g}, {gain:g}", [bootstrap_coverage(n, loss, gain) for n in SIZES])
    yield from (
        "",
        "The bootstrap falls short where few discordant pairs are expected: with none observed it has no "
        "width (the report marks it `degenerate`), and with a handful it is too narrow. Read it together "
        "with the counts of regressions and gains, and with the exact McNemar test, which keeps its level "
        "at every size.",
    )


def _row(name: str, values: list[float]) -> str:
    return f"| {name} | " + " | ".join(f"{100 * v:.1f}%{' !' if v < 0.93 else ''}" for v in values) + " |"


def _holds_rate(count: int, n: int, rate: float) -> bool:
    interval = wilson(Ratio(count, n))
    assert interval is not None
    return interval.lower <= rate <= interval.upper


def _holds_change(n: int, losses: int, gains: int, truth: float) -> bool:
    interval = _interval(n, losses, gains)
    return interval.lower - 1e-12 <= truth <= interval.upper + 1e-12


@cache
def _interval(n: int, losses: int, gains: int) -> MeanChange:
    interval = mean_change(np.repeat([-1, 0, 1], [losses, n - losses - gains, gains]))
    assert interval is not None
    return interval


if __name__ == "__main__":
    print(markdown(), end="")
