"""Repeats: what plays of the same cases with other policy seeds show."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

import numpy as np

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.stats.durations import LEAST_DIFFERENT, mean_difference_interval
from pytest_libero_max.stats.nested import variance_components
from pytest_libero_max.studies.repeats import repeated

TITLE = "Repeats with other policy seeds"
NOTE = (
    "Headline, gates and tests are of the first play of each case, with its own policy seed. Here a case is "
    "one unit however often it was played. Standard errors are those expected if tasks, cases and seeds were "
    "drawn again."
)
_LISTED = 20

Rows = dict[str, str | int | float | bool | None]


def repeats_section(
    records: Sequence[PairRecord], tasks: Sequence[str], *, with_intervals: bool = True
) -> dict[str, Rows]:
    """Return a section of the report on repeated cases; empty without any.

    Args:
        records: Played cases of the study ``repeats``.
        tasks: The task of each.
        with_intervals: False where a rule has ended the run.
    """
    if not records:
        return {}
    plays = 1
    while all(repeated(BASE, plays + 1) in record.arms for record in records):
        plays += 1
    numbers = range(1, plays + 1)
    base, dynamic = (
        np.array([[record.arms[repeated(arm, play)].success for play in numbers] for record in records])
        for arm in (BASE, DYNAMIC)
    )
    changes = dynamic.astype(int) - base
    lost = (base & ~dynamic).mean(axis=1)
    rows: Rows = {"Cases": len(records), "Plays of each": plays}
    others = [
        record.arms[repeated(arm, play)].proof != record.arms[arm].proof
        for record in records
        for arm in (BASE, DYNAMIC)
        for play in numbers[1:]
    ]
    rows["Rollouts that differ from the first play"] = f"{sum(others)}/{len(others)}"
    if not any(others):
        rows["What the repeats bought"] = "nothing: the policy does the same with each of these seeds"
        return {TITLE: rows}
    means = changes.mean(axis=1)
    rows["Paired change, mean over plays"] = f"{points(fmean(means))} pp"
    if with_intervals:
        interval = mean_difference_interval(means)
        rows["... its interval, by case"] = (
            f"n/a: {np.count_nonzero(means)} of {LEAST_DIFFERENT} needed cases change"
            if interval is None
            else f"[{points(interval.lower)}, {points(interval.upper)}] pp, 95%"
        )
    rows |= _chance(changes)
    rows |= _variances(changes, tasks)
    rows["Probability of a regression, mean over cases"] = percent(fmean(lost))
    found = sorted((-share, record.item_id) for share, record in zip(lost, records, strict=True) if share)
    for share, name in found[:_LISTED]:
        rows[f"... {name}"] = f"{round(-share * plays)}/{plays} plays"
    if len(found) > _LISTED:
        rows["... of other cases"] = f"{len(found) - _LISTED} more have one"
    return {TITLE: rows}


def _chance(changes: np.ndarray) -> Rows:
    """Return the rows on flips by chance.

    The product of the changes of two plays of a case has the square of its true change as expectation: flips
    beyond chance. It can come out below 0.

    Args:
        changes: (cases, plays) -1, 0 or 1.
    """
    plays = changes.shape[1]
    products = (changes.sum(axis=1) ** 2 - (changes**2).sum(axis=1)) / (plays * (plays - 1))
    flips = float((changes**2).mean())
    return {
        "Base and Dynamic end differently": f"{percent(flips)} of plays",
        "... beyond what seeds alone make": f"{points(float(products.mean()))} pp",
    }


def _variances(changes: np.ndarray, tasks: Sequence[str]) -> Rows:
    """Return the rows on variances, and on what more cases and more plays would buy."""
    found = variance_components(changes, tasks)
    if found is None:
        return {}
    if (changes == changes[0, 0]).all():
        return {"Variances": "n/a: all plays of all cases change alike"}
    rows: Rows = {}
    for name, variance in (
        ("tasks", found.tasks),
        ("cases of a task", found.cases),
        ("plays of a case", found.plays),
    ):
        rows[f"Variance between {name}"] = "n/a: too few" if variance is None else f"{variance:.4f}"
    for name, factors in (
        ("of these plays", (1, 1)),
        ("with twice the cases", (2, 1)),
        ("with twice the plays", (1, 2)),
    ):
        error = found.standard_error(*factors)
        rows[f"Standard error of the paired change {name}"] = (
            "n/a" if error is None else f"{100 * error:.2f} pp"
        )
    return rows
