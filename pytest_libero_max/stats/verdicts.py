"""Words for a paired difference: what a test that found nothing has shown."""

from __future__ import annotations

from typing import Literal

from pytest_libero_max.stats.intervals import Interval

Word = Literal["significant", "bounded null", "uninformative", "powerless"]

MARGIN = 0.05
"""Difference from which on it matters."""

WORDS: dict[Word, str] = {
    "significant": "a difference is shown",
    "bounded null": f"no difference is shown, and {100 * MARGIN:g} points or more are excluded",
    "uninformative": f"no difference is shown, and {100 * MARGIN:g} points or more are possible",
    "powerless": "too few pairs differ for any result to be significant",
}
"""The words with their meaning. The words are those of paired-eval; a bounded null is shown equivalence."""


def word_for(
    log10_p: float,
    interval: Interval,
    differing: int | None = None,
    *,
    comparisons: int = 1,
    margin: float = MARGIN,
    level: float = 0.05,
) -> Word:
    """Return the word for a difference.

    Args:
        log10_p: Decimal logarithm of the p-value, adjusted for all comparisons.
        interval: The interval of the difference, simultaneous with those of all comparisons.
        differing: Number of pairs in which the two differ, of which an exact McNemar test is made; None for
            another test, of which it is not known when it has no power.
        margin: Difference from which on it matters, above 0.
    """
    if 10**log10_p < level:
        return "significant"
    if -margin < interval.lower and interval.upper < margin:
        return "bounded null"
    if differing is not None and 2.0 ** (1 - differing) * comparisons >= level:
        return "powerless"
    return "uninformative"
