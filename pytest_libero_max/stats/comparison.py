"""Several conditions on the same cases: contrasts with Holm's correction, ranks, profiles, flips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from pytest_libero_max.errors import ReportError
from pytest_libero_max.stats.intervals import Interval, MeanChange, mean_change
from pytest_libero_max.stats.outcomes import BoolArray, boolean
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.significance import McNemar, holm, mcnemar


@dataclass(frozen=True)
class Contrast:
    """Two conditions on the same cases.

    Attributes:
        first: Name of the one.
        second: Name of the other.
        first_only: Cases in which only the first succeeds.
        second_only: Cases in which only the second succeeds.
        difference: Mean of (second - first) with its paired bootstrap interval; None without cases.
        interval: Exact interval of the same, which agrees with the uncorrected test; None without cases.
        test: Exact McNemar test, uncorrected.
        log10_p_holm: Its p-value after Holm's correction over the family of contrasts; None if untestable.
    """

    first: str
    second: str
    first_only: int
    second_only: int
    difference: MeanChange | None
    interval: Interval | None
    test: McNemar
    log10_p_holm: float | None


@dataclass(frozen=True)
class ProfileAgreement:
    """How alike several profiles (one value per event) rank their entries.

    Attributes:
        correlations: Spearman's coefficient by pair of names; None where a profile is constant.
        mean: Mean over the pairs that have one; None without any, like the two below.
        lowest: Smallest of them.
        highest: Largest of them.
    """

    correlations: Mapping[tuple[str, str], float | None]
    mean: float | None
    lowest: float | None
    highest: float | None


def contrasts(
    successes: Mapping[str, ArrayLike],
    strata: ArrayLike | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
) -> tuple[Contrast, ...]:
    """Compare conditions with each other on common cases.

    Args:
        successes: (n,) bool by condition; the same case at the same place in each.
        strata: (n,) labels whose composition the bootstrap keeps, or None.
        pairs: Which conditions to compare; by default all pairs in the order of ``successes``. Holm's
            correction is over exactly these.

    Raises:
        ReportError: The arrays differ in length.
    """
    columns = {name: boolean(values, name) for name, values in successes.items()}
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ReportError(f"Outcomes have the lengths {lengths}, but contrasts need common cases.")
    chosen = list(combinations(columns, 2)) if pairs is None else list(pairs)
    tests = [
        mcnemar(_only(columns[first], columns[second]), _only(columns[second], columns[first]))
        for first, second in chosen
    ]
    adjusted = holm([test.log10_p for test in tests])
    cases = next(iter(lengths.values()), 0)
    intervals = paired_differences([(test.losses, test.gains, cases) for test in tests])
    return tuple(
        Contrast(
            first=first,
            second=second,
            first_only=test.losses,
            second_only=test.gains,
            difference=mean_change(columns[second].astype(np.int64) - columns[first], strata),
            interval=interval,
            test=test,
            log10_p_holm=corrected,
        )
        for (first, second), test, interval, corrected in zip(chosen, tests, intervals, adjusted, strict=True)
    )


def ranks(values: Mapping[str, float | None]) -> dict[str, float | None]:
    """Rank 1 for the largest value; equal values share the mean of their ranks, None has no rank."""
    known = {name: value for name, value in values.items() if value is not None}
    ranked = dict(zip(known, stats.rankdata([-value for value in known.values()]).tolist(), strict=True))
    return {name: ranked.get(name) for name in values}


def profile_agreement(profiles: Mapping[str, Sequence[float]]) -> ProfileAgreement:
    """Spearman's rank correlation between all pairs of profiles, ties by mean ranks.

    Reference: C. Spearman (1904), Am. J. Psychol. 15:72-101. A constant profile has no ranking, so its
    correlations are None.
    """
    correlations: dict[tuple[str, str], float | None] = {}
    for first, second in combinations(profiles, 2):
        one, other = (stats.rankdata(profiles[name]) for name in (first, second))
        constant = np.ptp(one) == 0 or np.ptp(other) == 0
        correlations[first, second] = None if constant else float(np.corrcoef(one, other)[0, 1])
    known = [value for value in correlations.values() if value is not None]
    return ProfileAgreement(
        correlations=correlations,
        mean=float(np.mean(known)) if known else None,
        lowest=min(known, default=None),
        highest=max(known, default=None),
    )


def _only(one: BoolArray, other: BoolArray) -> int:
    return int((one & ~other).sum())
