"""Numbers of reports: rounded, with their counts and intervals, as blocks."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np
from msgspec import structs
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.stats import blocks
from pytest_libero_max.stats.blocks import (
    FLOOR_BASE_RATE,
    Block,
    Bootstrap,
    McNemar,
    MeanDifference,
    Outcomes,
    Rate,
)
from pytest_libero_max.stats.intervals import Interval, MeanChange, clopper_pearson
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.significance import mcnemar

BoolArray = NDArray[np.bool_]


def tabulate(base: ArrayLike, dynamic: ArrayLike) -> Outcomes:
    """Count the four outcomes."""
    first, second = np.asarray(base, dtype=np.bool_), np.asarray(dynamic, dtype=np.bool_)
    failed, gained, regressed, preserved = np.bincount(2 * first + second, minlength=4).tolist()
    return Outcomes(preserved, gained, regressed, failed)


def at_floor(outcomes: Outcomes) -> bool | None:
    """Return True if Base success leaves too little room to fall; None without pairs."""
    rate = outcomes.base.value
    return None if rate is None else rate < FLOOR_BASE_RATE


B = TypeVar("B", bound=Block)


class _Ends(Protocol):
    @property
    def lower(self) -> float: ...

    @property
    def upper(self) -> float: ...


_OF_INTERVALS = ("lower", "upper", "p_value", "log10_p_value", "log10_p_value_holm")


def without_intervals(block: B) -> B:
    """Return a block of a run that a rule stopped: intervals and p-values are None, also of blocks in it."""
    fields = structs.asdict(block)
    changed = {name: _without_intervals(value) for name, value in fields.items()}
    changed |= dict.fromkeys(fields.keys() & _OF_INTERVALS)
    changed |= {"withheld": True} if "withheld" in fields else {}
    if isinstance(block, blocks.Measure) and block.value is not None:
        changed["lack"] = ""  # which says why there is no interval
    return structs.replace(block, **changed)


def _without_intervals(value: object) -> object:
    if isinstance(value, Block):
        return without_intervals(value)
    if isinstance(value, dict):
        return {name: _without_intervals(item) for name, item in value.items()}
    return [_without_intervals(item) for item in value] if isinstance(value, list) else value


def number(value: float | None) -> float | None:
    """Round to twelve significant digits: all that is meant, and the same text on every machine."""
    return None if value is None else float(f"{value:.12g}")


def ratio_of(ratio: Ratio) -> blocks.Ratio:
    """Return a ratio with its counts."""
    return blocks.Ratio(count=ratio.count, of=ratio.of, value=number(ratio.value))


def rate_of(ratio: Ratio, *, with_interval: bool = True) -> Rate:
    """Return a ratio with its counts and exact interval; without one where a rule has ended the run."""
    lower, upper = ends(clopper_pearson(ratio) if with_interval else None)
    return Rate(count=ratio.count, of=ratio.of, value=number(ratio.value), lower=lower, upper=upper)


def mean_difference_of(difference: Ratio, interval: Interval | None) -> MeanDifference:
    """Return a mean of paired differences of success with its interval."""
    lower, upper = ends(interval)
    return MeanDifference(
        count=difference.count, of=difference.of, value=number(difference.value), lower=lower, upper=upper
    )


def table_change_of(table: Outcomes, *, with_interval: bool = True) -> MeanDifference:
    """Return the paired change of a table of outcomes with its exact interval; see :func:`rate_of`."""
    exact = paired_difference(table.regression, table.change_associated_success, table.total)
    return mean_difference_of(table.change, exact if with_interval else None)


def mcnemar_of(table: Outcomes) -> McNemar:
    """Return the test of regressions against gains; without a p-value where there is no pair."""
    losses, gains = table.regression, table.change_associated_success
    log10_p = mcnemar(losses, gains) if table.total else None
    return McNemar(
        regressions=losses,
        gains=gains,
        p_value=None if log10_p is None else number(10**log10_p),
        log10_p_value=number(log10_p),
    )


def ends(interval: _Ends | None) -> tuple[float | None, float | None]:
    """Return both ends of an interval; None where there is none."""
    return (None, None) if interval is None else (number(interval.lower), number(interval.upper))


def interval_of(interval: _Ends | None) -> blocks.Interval:
    """Return an interval; None at both ends where there is none."""
    lower, upper = ends(interval)
    return blocks.Interval(lower=lower, upper=upper)


def bootstrap_of(change: MeanChange | None) -> Bootstrap:
    """Return the paper's interval; None at both ends where there is none."""
    lower, upper = ends(change)
    return Bootstrap(lower=lower, upper=upper, degenerate=change.degenerate if change else None)
