"""Repeats: what plays of the same cases with other policy seeds show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import ClassVar

import numpy as np

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.lab.studies.repeats import Repeats, repeated
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.measures import Measured, Rows
from pytest_libero_max.report.sections import PlayedPairs, ReportSection
from pytest_libero_max.stats.intervals import LEAST_DIFFERENT, mean_difference_interval

TITLE = "Repeats with other policy seeds"
NOTE = (
    "Headline, gates and tests are of the first play of each case, with its own policy seed. Here a case is "
    "one unit however often it was played."
)
_LISTED = 20

_DIFFERING = Measured("repeats.differing", "Rollouts that differ from the first play", "share")
_CHANGE = Measured("repeats.change", "Paired change, mean over plays", "change")
_FLIPS = Measured("repeats.flips", "Plays of which Base and Dynamic end differently", "share")
_BEYOND = Measured("repeats.flips_beyond_seeds", "... beyond what seeds alone make", "change")
_LOST = Measured("repeats.regression", "Probability of a regression, mean over cases", "share")


class RepeatedCases(ReportSection):
    """Cases of the study ``repeats``."""

    name = "repeats"
    quantities = (_DIFFERING, _CHANGE, _FLIPS, _BEYOND, _LOST)
    option = "--libero-max-study=repeats"
    notes: ClassVar[Mapping[str, str]] = {TITLE: NOTE}

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        study = played.protocol.get("study") or {}
        if not played.records or study.get("name") != Repeats.name:
            return {}
        return {TITLE: _repeated_cases(played.records)}


def _repeated_cases(records: Sequence[PairRecord]) -> Rows:
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
    rows |= _DIFFERING.share(others, with_interval=False)
    if not any(others):
        rows["What the repeats bought"] = "nothing: the policy does the same with each of these seeds"
        return rows
    means = changes.mean(axis=1)
    interval = mean_difference_interval(means)
    lack = f"{np.count_nonzero(means)} of {LEAST_DIFFERENT} needed cases change"
    rows |= _CHANGE.row(fmean(means), interval, lack=lack if interval is None else "")
    rows |= _chance(changes)
    rows |= _LOST.row(fmean(lost))
    shares = sorted((-share, record.item_id) for share, record in zip(lost, records, strict=True) if share)
    for share, name in shares[:_LISTED]:
        rows[f"... {name}"] = f"{round(-share * plays)}/{plays} plays"
    if len(shares) > _LISTED:
        rows["... of other cases"] = f"{len(shares) - _LISTED} more have one"
    return rows


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
    return _FLIPS.row(flips) | _BEYOND.row(float(products.mean()))
