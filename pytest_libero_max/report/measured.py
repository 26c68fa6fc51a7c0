"""Statistics as blocks of the report: the one place that assigns numbers to fields."""

from __future__ import annotations

from typing import TypeVar

import msgspec
from msgspec import structs
from msgspec.structs import asdict

from pytest_libero_max.report import blocks
from pytest_libero_max.report.blocks import (
    Block,
    Bootstrap,
    Bootstraps,
    Change,
    McNemar,
    MeanDifference,
    Rate,
    Result,
    StaleActions,
)
from pytest_libero_max.stats.breakdown import at_floor
from pytest_libero_max.stats.clusters import ClusterInterval, TaskInterval
from pytest_libero_max.stats.exposure import Exposure
from pytest_libero_max.stats.intervals import Interval, MeanChange, clopper_pearson
from pytest_libero_max.stats.outcome_table import Outcomes, Ratio
from pytest_libero_max.stats.paired import PairedResult
from pytest_libero_max.stats.paired_difference import paired_difference

B = TypeVar("B", bound=Block)


def result_of(result: PairedResult, planned: int) -> Result:
    """Return a measured set of pairs, with the number of planned ones."""
    outcomes, given = result.outcomes, result.given_response
    return Result(
        planned=planned,
        played=outcomes.total,
        base_success=rate_of(outcomes.base),
        dynamic_success=rate_of(outcomes.dynamic),
        paired_change=change_of(result),
        by_task=blocks.RatesByTask(
            base_success=_by_task(result.base_by_task, number(outcomes.base.value)),
            dynamic_success=_by_task(result.dynamic_by_task, number(outcomes.dynamic.value)),
            conditional_regression=_by_task(
                result.lost_by_task, number(outcomes.conditional_regression.value)
            ),
        ),
        outcomes=outcomes_of(outcomes),
        conditional_regression=rate_of(outcomes.conditional_regression),
        retained=ratio_of(outcomes.retained),
        mcnemar=McNemar(
            regressions=result.mcnemar.losses,
            gains=result.mcnemar.gains,
            p_value=number(result.mcnemar.p_value if outcomes.total else None),
            log10_p_value=number(result.mcnemar.log10_p if outcomes.total else None),
        ),
        trigger_coverage=rate_of(result.trigger_coverage),
        response_coverage=rate_of(result.response_coverage),
        stale_actions=stale_of(result.exposure),
        given_response=blocks.GivenResponse(
            base_success=ratio_of(given.base),
            dynamic_success=ratio_of(given.dynamic),
            paired_change=ratio_of(given.change),
            outcomes=outcomes_of(given),
        ),
        floor=at_floor(outcomes),
    )


_OF_INTERVALS = ("lower", "upper", "p_value", "log10_p_value", "log10_p_value_holm")


def without_intervals(block: B) -> B:
    """Return a block whose intervals and p-values are None, those of all blocks in it too."""
    fields = structs.asdict(block)
    changed = {name: _without_intervals(value) for name, value in fields.items()}
    changed |= dict.fromkeys(fields.keys() & _OF_INTERVALS)
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


def change_of(result: PairedResult) -> Change:
    """Return the paired change: exact interval, the one clustered by task, and the paper's two bootstraps."""
    whole, change = result.bootstrap, mean_difference_of(result.outcomes.change, result.change)
    lower, upper = ends(whole)
    return Change(
        **asdict(change),
        by_task=_by_task(result.change_by_task, change.value),
        bootstrap=Bootstraps(
            lower=lower,
            upper=upper,
            degenerate=whole.degenerate if whole else None,
            by_source=bootstrap_of(result.bootstrap_by_source),
        ),
    )


def ends(interval: Interval | MeanChange | ClusterInterval | None) -> tuple[float | None, float | None]:
    """Return both ends of an interval; None where there is none."""
    return (None, None) if interval is None else (number(interval.lower), number(interval.upper))


def interval_of(interval: Interval | MeanChange | ClusterInterval | None) -> blocks.Interval:
    """Return an interval; None at both ends where there is none."""
    lower, upper = ends(interval)
    return blocks.Interval(lower=lower, upper=upper)


def outcomes_of(outcomes: Outcomes) -> blocks.Outcomes:
    """Return the four counts under the names of the pair record."""
    return msgspec.convert(outcomes, blocks.Outcomes, from_attributes=True)


def stale_of(exposure: Exposure) -> StaleActions:
    """Return the stale actions."""
    return StaleActions(
        pairs=exposure.pairs,
        unanswered=exposure.unanswered,
        mean=number(exposure.mean),
        median=number(exposure.median),
        quantiles=dict(exposure.quantiles),
        histogram={str(value): count for value, count in exposure.histogram.items()},
    )


def _by_task(interval: TaskInterval, value: float | None) -> blocks.TaskInterval:
    lower, upper = ends(interval.interval)
    return blocks.TaskInterval(
        tasks=interval.tasks,
        effective_tasks=number(interval.effective) or 0.0,
        changed_tasks=interval.changed,
        lower=lower,
        upper=upper,
        value=value,
    )


def bootstrap_of(change: MeanChange | None) -> Bootstrap:
    """Return the paper's interval; None at both ends where there is none."""
    lower, upper = ends(change)
    return Bootstrap(lower=lower, upper=upper, degenerate=change.degenerate if change else None)
