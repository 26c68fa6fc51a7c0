"""Results as JSON: the one place that says how a statistic is spelled in the report."""

from __future__ import annotations

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.stats.breakdown import MacroAverage, Split, at_floor
from pytest_libero_max.stats.clusters import TaskInterval
from pytest_libero_max.stats.comparison import ChangeContrast, Contrast, GroupContrast
from pytest_libero_max.stats.exposure import Exposure
from pytest_libero_max.stats.intervals import Interval, MeanChange
from pytest_libero_max.stats.outcome_table import Outcomes, Ratio
from pytest_libero_max.stats.paired import PairedResult


def result_json(result: PairedResult, planned: int) -> Json:
    """A measured set of pairs, with how many were planned."""
    outcomes = result.outcomes
    return {
        "planned": planned,
        "played": outcomes.total,
        "base_success": rate_json(outcomes.base, result.base),
        "dynamic_success": rate_json(outcomes.dynamic, result.dynamic),
        "paired_change": change_json(result),
        "outcomes": outcomes_json(outcomes),
        "conditional_regression": rate_json(outcomes.conditional_regression, result.conditional_regression),
        "retained": ratio_json(outcomes.retained),
        "mcnemar": {
            "regressions": result.mcnemar.losses,
            "gains": result.mcnemar.gains,
            "p_value": number(result.mcnemar.p_value if outcomes.total else None),
            "log10_p_value": number(result.mcnemar.log10_p if outcomes.total else None),
        },
        "trigger_coverage": rate_json(result.trigger_coverage, result.trigger_interval),
        "response_coverage": rate_json(result.response_coverage, result.response_interval),
        "stale_actions": exposure_json(result.exposure),
        "given_response": {
            "base_success": ratio_json(result.given_response.base),
            "dynamic_success": ratio_json(result.given_response.dynamic),
            "paired_change": ratio_json(result.given_response.change),
            "outcomes": outcomes_json(result.given_response),
        },
        "floor": at_floor(outcomes),
    }


def number(value: float | None) -> float | None:
    """Twelve significant digits: all that is meant, and the same text on every machine."""
    return None if value is None else float(f"{value:.12g}")


def ratio_json(ratio: Ratio) -> Json:
    """A ratio with its counts."""
    return {"count": ratio.count, "of": ratio.of, "value": number(ratio.value)}


def rate_json(ratio: Ratio, interval: Interval | None) -> Json:
    """A ratio with its counts and interval."""
    return {
        **ratio_json(ratio),
        **interval_json(interval),
    }


def change_json(result: PairedResult) -> Json:
    """The paired change: exact interval, the one clustered by task, and the paper's two bootstraps."""

    def bootstrap(change: MeanChange | None) -> Json:
        return {
            "lower": number(change.lower if change else None),
            "upper": number(change.upper if change else None),
            "degenerate": change.degenerate if change else None,
        }

    return {
        **ratio_json(result.outcomes.change),
        **interval_json(result.change),
        "by_task": {
            **task_json(result.change_by_task),
            "value": number(result.outcomes.change.value),
        },
        "bootstrap": {
            **bootstrap(result.bootstrap),
            "by_source": bootstrap(result.bootstrap_by_source),
        },
    }


def task_json(interval: TaskInterval) -> Json:
    """An interval for other tasks of the same kind, with how many tasks it is from."""
    return {
        "tasks": interval.tasks,
        "changed_tasks": interval.changed,
        **interval_json(interval.interval),
    }


def interval_json(interval: Interval | None) -> Json:
    """Both ends of an interval; None where there is none."""
    return {
        "lower": number(interval.lower if interval else None),
        "upper": number(interval.upper if interval else None),
    }


def outcomes_json(outcomes: Outcomes) -> Json:
    """The four counts under the names of the pair record."""
    return {
        "preserved_success": outcomes.preserved_success,
        "change_associated_success": outcomes.change_associated_success,
        "regression": outcomes.regression,
        "persistent_failure": outcomes.persistent_failure,
    }


def exposure_json(exposure: Exposure) -> Json:
    """Stale actions."""
    return {
        "pairs": exposure.pairs,
        "unanswered": exposure.unanswered,
        "mean": number(exposure.mean),
        "median": number(exposure.median),
        "quantiles": dict(exposure.quantiles),
        "histogram": {str(value): count for value, count in exposure.histogram.items()},
    }


def macro_json(macro: MacroAverage) -> Json:
    """A macro average."""
    return {
        "groups": macro.groups,
        "base_success": number(macro.base),
        "dynamic_success": number(macro.dynamic),
        "paired_change": number(macro.change),
    }


def split_json(split: Split | None) -> Json | None:
    """The largest split, None where there is none."""
    if split is None:
        return None
    return {
        "event": split.event,
        "dynamic_success": {name: number(rate) for name, rate in split.rates.items()},
        "difference": number(split.difference),
    }


def contrast_json(contrast: Contrast) -> Json:
    """A contrast of two conditions."""
    difference = contrast.difference
    return {
        "first": contrast.first,
        "second": contrast.second,
        "first_only": contrast.first_only,
        "second_only": contrast.second_only,
        "difference": {
            "value": number(difference.estimate if difference else None),
            **interval_json(contrast.interval),
            "simultaneous": interval_json(contrast.simultaneous),
            "bootstrap": {
                "lower": number(difference.lower if difference else None),
                "upper": number(difference.upper if difference else None),
            },
        },
        "p_value": number(contrast.test.p_value),
        "log10_p_value": number(contrast.test.log10_p),
        "log10_p_value_holm": number(contrast.log10_p_holm),
    }


def change_contrast_json(contrast: ChangeContrast) -> Json:
    """A contrast of two paired changes."""
    return {
        "first": contrast.first,
        "second": contrast.second,
        "second_lower": contrast.second_lower,
        "second_higher": contrast.second_higher,
        "difference": {
            "value": number(contrast.difference),
            **interval_json(contrast.interval),
            "simultaneous": interval_json(contrast.simultaneous),
        },
        "log10_p_value": number(contrast.log10_p),
        "log10_p_value_holm": number(contrast.log10_p_holm),
    }


def group_contrast_json(contrast: GroupContrast) -> Json:
    """A contrast of two conditions within a group of cases."""
    return {
        "first": contrast.first,
        "second": contrast.second,
        "cases": contrast.cases,
        "difference": {
            "value": number(contrast.difference),
            "simultaneous": interval_json(contrast.simultaneous),
        },
        "log10_p_value_holm": number(contrast.log10_p_holm),
    }
