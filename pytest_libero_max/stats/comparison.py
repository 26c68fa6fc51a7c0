"""Several conditions on the same cases: contrasts with Holm's correction, ranks, profiles, flips."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from msgspec.structs import asdict, astuple
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.stats.blocks import (
    BestSetting,
    ChangeContrast,
    ChangeDifference,
    GroupContrast,
    GroupDifference,
    SettingDifference,
    SuccessContrast,
    SuccessDifference,
)
from pytest_libero_max.stats.bounded_mean import bounded_means
from pytest_libero_max.stats.clusters import task_interval
from pytest_libero_max.stats.intervals import CONFIDENCE, Interval, clopper_pearson, mean_change
from pytest_libero_max.stats.measured import BoolArray, ends, interval_of, number, ratio_of
from pytest_libero_max.stats.paired_difference import paired_differences
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.significance import holm, log_fair_coins, mcnemar

_MOST = 2
"""Largest difference of two paired changes."""


@dataclass(frozen=True)
class ProfileAgreement:
    """Agreement of several profiles (one value per event) in ranking their entries."""

    correlations: Mapping[tuple[str, str], float | None]
    """Spearman's coefficient by pair of names; None where a profile is constant."""
    mean: float | None
    """Mean over the pairs that have one; None without any, like the two below."""
    lowest: float | None
    highest: float | None


def contrasts(
    successes: Mapping[str, ArrayLike],
    strata: ArrayLike | None = None,
    pairs: Sequence[tuple[str, str]] | None = None,
    tasks: ArrayLike | None = None,
) -> tuple[SuccessContrast, ...]:
    """Compare conditions with each other on common cases.

    Args:
        successes: (n,) bool by condition; the same case at the same place in each.
        strata: (n,) labels whose composition the bootstrap keeps, or None.
        pairs: Conditions to compare; by default all pairs in the order of ``successes``. Holm's
            correction is over exactly these.
        tasks: (n,) the task of each case, for intervals that take the cases of a task as one draw, or None.
    """
    columns = {name: np.asarray(values, dtype=np.bool_) for name, values in successes.items()}
    chosen = list(combinations(columns, 2)) if pairs is None else list(pairs)
    cases = len(next(iter(columns.values()), ()))
    counts = [
        (_only(columns[first], columns[second]), _only(columns[second], columns[first]), cases)
        for first, second in chosen
    ]
    tests = [mcnemar(losses, gains) for losses, gains, _ in counts]
    intervals = paired_differences(counts)
    together = intervals if len(tests) < 2 else paired_differences(counts, _family_confidence(len(tests)))
    return tuple(
        SuccessContrast(
            first=first,
            second=second,
            cases=cases,
            first_only=losses,
            second_only=gains,
            difference=_success_difference(
                columns[second].astype(np.int64) - columns[first], interval, simultaneous, strata, tasks
            ),
            p_value=number(10**test),
            log10_p_value=number(test),
            log10_p_value_holm=number(corrected),
        )
        for (first, second), (losses, gains, _), test, interval, simultaneous, corrected in zip(
            chosen, counts, tests, intervals, together, holm(tests), strict=True
        )
    )


def _success_difference(
    change: NDArray[np.int64],
    interval: Interval | None,
    simultaneous: Interval | None,
    strata: ArrayLike | None,
    tasks: ArrayLike | None,
) -> SuccessDifference:
    bootstrap, (lower, upper) = mean_change(change, strata), ends(interval)
    return SuccessDifference(
        value=number(bootstrap.estimate if bootstrap else None),
        lower=lower,
        upper=upper,
        simultaneous=interval_of(simultaneous),
        bootstrap=interval_of(bootstrap),
        by_task=None if tasks is None else task_interval(change, tasks, interval),
    )


def group_contrasts(
    successes: Mapping[str, BoolArray], groups: Mapping[str, BoolArray]
) -> dict[str, tuple[GroupContrast, ...]]:
    """Contrasts of success within groups of cases; one family of all conditions and groups.

    Args:
        successes: (n,) bool by condition; the same case at the same place in each.
        groups: (n,) bool by group, which cases it holds.
    """
    names = list(combinations(successes, 2))
    counts = [
        (
            _only(successes[first][mask], successes[second][mask]),
            _only(successes[second][mask], successes[first][mask]),
            int(mask.sum()),
        )
        for mask in groups.values()
        for first, second in names
    ]
    tests = [mcnemar(losses, gains) if cases else None for losses, gains, cases in counts]
    intervals = paired_differences(counts, _family_confidence(len(counts)))
    differences = [(gains - losses) / cases if cases else None for losses, gains, cases in counts]
    return _by_group(groups, names, differences, intervals, tests)


def group_change_contrasts(
    base: Mapping[str, BoolArray], dynamic: Mapping[str, BoolArray], groups: Mapping[str, BoolArray]
) -> dict[str, tuple[GroupContrast, ...]]:
    """Contrasts of paired changes within groups of cases; one family of all conditions and groups."""
    changes = {name: dynamic[name].astype(np.int64) - base[name] for name in base}
    names = list(combinations(changes, 2))
    values = [
        changes[second][mask] - changes[first][mask] for mask in groups.values() for first, second in names
    ]
    return _by_group(
        groups,
        names,
        [float(value.mean()) if len(value) else None for value in values],
        bounded_means(values, _MOST, _family_confidence(len(values))),
        [sign_flip(value) for value in values],
    )


def _by_group(
    groups: Mapping[str, BoolArray],
    names: Sequence[tuple[str, str]],
    differences: Sequence[float | None],
    intervals: Sequence[Interval | None],
    tests: Sequence[float | None],
) -> dict[str, tuple[GroupContrast, ...]]:
    """Return the contrasts of each pair of names in every group; values of a group follow each other."""
    rows = iter(zip(differences, intervals, holm(tests), strict=True))

    def contrast(first: str, second: str, cases: int) -> GroupContrast:
        value, interval, log10_p = next(rows)
        return GroupContrast(
            first=first,
            second=second,
            cases=cases,
            difference=GroupDifference(value=number(value), simultaneous=interval_of(interval)),
            log10_p_value_holm=number(log10_p),
        )

    return {
        group: tuple(contrast(*pair, int(mask.sum())) for pair in names) for group, mask in groups.items()
    }


def change_contrasts(
    base: Mapping[str, ArrayLike], dynamic: Mapping[str, ArrayLike], tasks: ArrayLike | None = None
) -> tuple[ChangeContrast, ...]:
    """Compare the paired changes of conditions on common cases, all pairs of conditions."""
    changes = {
        name: np.asarray(dynamic[name], dtype=np.int64) - np.asarray(base[name], dtype=np.int64)
        for name in base
    }
    chosen = list(combinations(changes, 2))
    differences = [changes[second] - changes[first] for first, second in chosen]
    tests = [sign_flip(difference) for difference in differences]
    intervals = bounded_means(differences, _MOST)
    together = bounded_means(differences, _MOST, _family_confidence(len(chosen)))
    return tuple(
        ChangeContrast(
            first=first,
            second=second,
            second_lower=int((difference < 0).sum()),
            second_higher=int((difference > 0).sum()),
            difference=ChangeDifference(
                value=number(float(difference.mean()) if len(difference) else None),
                lower=ends(interval)[0],
                upper=ends(interval)[1],
                simultaneous=interval_of(simultaneous),
                by_task=None
                if tasks is None
                else task_interval(difference, tasks, interval, bounds=(-_MOST, _MOST)),
            ),
            log10_p_value=number(test),
            log10_p_value_holm=number(corrected),
        )
        for (first, second), difference, interval, simultaneous, test, corrected in zip(
            chosen, differences, intervals, together, tests, holm(tests), strict=True
        )
    )


def sign_flip(differences: ArrayLike) -> float | None:
    """Decimal logarithm of the p-value of the exact two-sided sign-flip test; None without a case.

    Under the null the two conditions of every case could be exchanged, so that every difference is as likely
    as its negative. Reference: R. A. Fisher (1935), The Design of Experiments, section 21. Below 1e-300 the
    logarithm is -300.

    Args:
        differences: (n,) integers from -2 to 2.
    """
    values = np.asarray(differences, dtype=np.int64)
    if values.size == 0:
        return None
    sizes = np.bincount(np.abs(values), minlength=3)
    single = np.exp(log_fair_coins(int(sizes[1])))
    double = np.zeros(2 * int(sizes[2]) + 1)
    double[::2] = np.exp(log_fair_coins(int(sizes[2])))
    mass = np.convolve(single, double)
    total = int(sizes[1] + 2 * sizes[2])  # entry k is the sum 2 k - total
    extreme = abs(int(values.sum()))
    if extreme <= 1:
        return 0.0  # no sum is nearer to zero
    tail = float(mass[: (total - extreme) // 2 + 1].sum())
    return max(-300.0, math.log10(min(1.0, 2 * tail))) if tail > 0 else -300.0


def _family_confidence(contrasts: int) -> float:
    """Return the level of an interval at which a whole family holds with the usual one (Bonferroni)."""
    return 1 - (1 - CONFIDENCE) / max(contrasts, 1)


def ranks(values: Mapping[str, float | None]) -> dict[str, float | None]:
    """Rank 1 for the largest value; equal values share the mean of their ranks, None has no rank."""
    known = {name: value for name, value in values.items() if value is not None}
    ranked = dict(zip(known, _mean_ranks([-value for value in known.values()]).tolist(), strict=True))
    return {name: ranked.get(name) for name in values}


def rank_sets(names: Sequence[str], family: Sequence[SuccessContrast]) -> dict[str, tuple[int, int]]:
    """Return the highest and the lowest rank of each condition that simultaneous intervals leave open.

    A condition is below those that its contrasts show to be better, and above those that they show to be
    worse. All sets together hold the true ranks with 95%. Reference: M. Mogstad, J. P. Romano, A. M. Shaikh
    and D. Wilhelm (2024), Inference for Ranks with Applications to Mobility across Neighbourhoods and
    Academic Achievement across Countries, Review of Economic Studies 91:476-518.
    """
    better, worse = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
    for contrast in family:
        together = contrast.difference.simultaneous
        if contrast.first not in better or contrast.second not in better or together.lower is None:
            continue
        if together.lower > 0:
            better[contrast.first] += 1
            worse[contrast.second] += 1
        elif together.upper is not None and together.upper < 0:
            better[contrast.second] += 1
            worse[contrast.first] += 1
    return {name: (1 + better[name], len(names) - worse[name]) for name in names}


def profile_agreement(profiles: Mapping[str, Sequence[float]]) -> ProfileAgreement:
    """Spearman's rank correlation between all pairs of profiles, ties by mean ranks.

    Reference: C. Spearman (1904), Am. J. Psychol. 15:72-101. A constant profile has no ranking, so its
    correlations are None.
    """
    correlations: dict[tuple[str, str], float | None] = {}
    for first, second in combinations(profiles, 2):
        first_ranks, second_ranks = (_mean_ranks(profiles[name]) for name in (first, second))
        constant = np.ptp(first_ranks) == 0 or np.ptp(second_ranks) == 0
        correlations[first, second] = (
            None if constant else float(np.corrcoef(first_ranks, second_ranks)[0, 1])
        )
    known = [value for value in correlations.values() if value is not None]
    return ProfileAgreement(
        correlations=correlations,
        mean=float(np.mean(known)) if known else None,
        lowest=min(known, default=None),
        highest=max(known, default=None),
    )


def _mean_ranks(values: Sequence[float]) -> NDArray[np.float64]:
    """Ranks from 1 for the smallest; equal values share the mean of theirs."""
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    first, end = (np.searchsorted(ordered, values, side=side) for side in ("left", "right"))
    return np.asarray((first + end + 1) / 2, dtype=np.float64)


def _only(first: BoolArray, second: BoolArray) -> int:
    return int((first & ~second).sum())


def best_of(successes: Mapping[str, BoolArray]) -> BestSetting:
    """Find the best of m conditions.

    The highest of several rates is too high on average, and an interval for it alone misses its true rate too
    often. So the interval of its rate is at the level 1 - 0.05 / m: all m such intervals hold together with
    95%, whichever is looked at (Bonferroni). Its differences from the others are held together with those of
    all m (m - 1) / 2 pairs, for the same reason. References: J. C. Hsu (1996), Multiple Comparisons, ch. 4;
    Y. Benjamini, D. Yekutieli (2005), JASA 100:71-81.

    Args:
        successes: (n,) bool by condition, the same case at the same place in each; n and m at least 1.
    """
    rates = {name: Ratio(int(column.sum()), len(column)) for name, column in successes.items()}
    name = max(rates, key=lambda condition: rates[condition].count)
    interval = clopper_pearson(rates[name], 1 - (1 - CONFIDENCE) / len(rates))
    assert interval is not None
    differences = {}
    for contrast in contrasts(successes):
        if name not in (contrast.first, contrast.second):
            continue
        low, high = astuple(contrast.difference.simultaneous)
        assert low is not None
        assert high is not None
        turned = contrast.second != name
        rival = contrast.second if turned else contrast.first
        differences[rival] = SettingDifference(
            value=number((rates[name].count - rates[rival].count) / rates[name].of),
            lower=number(-high if turned else low),
            upper=number(-low if turned else high),
        )
    lower, upper = ends(interval)
    return BestSetting(
        setting=name,
        **asdict(ratio_of(rates[name])),
        lower=lower,
        upper=upper,
        not_worse=[rival for rival, away in differences.items() if (away.lower or 0.0) <= 0],
        differences=differences,
    )
