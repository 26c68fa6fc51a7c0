"""Contrasts of runs as blocks of a comparison."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TypeVar

from pytest_libero_max.report.blocks import IntervalByTask
from pytest_libero_max.report.comparison.comparison_document import (
    ChangeContrast,
    ChangeDifference,
    GroupContrast,
    GroupDifference,
    SuccessContrast,
    SuccessDifference,
)
from pytest_libero_max.report.measured import ends, interval_of, number, without_intervals
from pytest_libero_max.stats import comparison as stats
from pytest_libero_max.stats.clusters import TaskInterval

AnyContrast = TypeVar("AnyContrast", SuccessContrast, ChangeContrast, GroupContrast)


def contrast_of(contrast: stats.Contrast, by_task: TaskInterval | None = None) -> SuccessContrast:
    """Return a contrast of the success of two runs.

    Args:
        contrast: The contrast.
        by_task: Its interval that takes the cases of a task as one draw.
    """
    difference = contrast.difference
    lower, upper = ends(contrast.interval)
    return SuccessContrast(
        first=contrast.first,
        second=contrast.second,
        cases=difference.pairs if difference else 0,
        first_only=contrast.first_only,
        second_only=contrast.second_only,
        difference=SuccessDifference(
            value=number(difference.estimate if difference else None),
            lower=lower,
            upper=upper,
            simultaneous=interval_of(contrast.simultaneous),
            bootstrap=interval_of(difference),
            by_task=_by_task(by_task),
        ),
        p_value=number(contrast.test.p_value),
        log10_p_value=number(contrast.test.log10_p),
        log10_p_value_holm=number(contrast.log10_p_holm),
    )


def change_contrast_of(contrast: stats.ChangeContrast, by_task: TaskInterval) -> ChangeContrast:
    """Return a contrast of the paired changes of two runs."""
    lower, upper = ends(contrast.interval)
    return ChangeContrast(
        first=contrast.first,
        second=contrast.second,
        second_lower=contrast.second_lower,
        second_higher=contrast.second_higher,
        difference=ChangeDifference(
            value=number(contrast.difference),
            lower=lower,
            upper=upper,
            simultaneous=interval_of(contrast.simultaneous),
            by_task=_by_task(by_task),
        ),
        log10_p_value=number(contrast.log10_p),
        log10_p_value_holm=number(contrast.log10_p_holm),
    )


def group_contrast_of(contrast: stats.GroupContrast) -> GroupContrast:
    """Return a contrast of two runs within an event."""
    return GroupContrast(
        first=contrast.first,
        second=contrast.second,
        cases=contrast.cases,
        difference=GroupDifference(
            value=number(contrast.difference), simultaneous=interval_of(contrast.simultaneous)
        ),
        log10_p_value_holm=number(contrast.log10_p_holm),
    )


def of_fixed_runs(contrasts: Iterable[AnyContrast], stopped: Collection[str]) -> list[AnyContrast]:
    """Return contrasts, without intervals and p-values where a rule stopped one of the runs.

    Args:
        contrasts: The contrasts.
        stopped: Names of the runs that a rule stopped.
    """
    return [
        without_intervals(one) if one.first in stopped or one.second in stopped else one for one in contrasts
    ]


def _by_task(interval: TaskInterval | None) -> IntervalByTask | None:
    if interval is None:
        return None
    lower, upper = ends(interval.interval)
    return IntervalByTask(
        tasks=interval.tasks,
        effective_tasks=number(interval.effective) or 0.0,
        changed_tasks=interval.changed,
        lower=lower,
        upper=upper,
    )
