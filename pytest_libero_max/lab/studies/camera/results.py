"""Camera timing and camera strength: rates, joint outcomes, contrasts and approach, from the records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.lab.studies.camera.blocks import (
    Camera,
    ConditionContrast,
    ConditionRate,
    GroupInterval,
    JointOutcome,
)
from pytest_libero_max.lab.studies.camera.conditions import Conditions, contrasts, contrasts_of_contrasts
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.document import Table, table_of
from pytest_libero_max.report.formats import NOT_AVAILABLE, Change, Interval, Number, Rate, interval_text
from pytest_libero_max.report.quantities import Quantity
from pytest_libero_max.stats.blocks import Bootstrap

Strengths = Mapping[float, tuple[str, str]]
"""Names of the arms of Reset and Mid-task by strength."""

_LISTED = 16
"""Number of joint outcomes that are printed; ``report.json`` has all."""


def camera_results(strengths: Strengths, records: Sequence[PairRecord], tasks: Sequence[str]) -> Camera:
    """Compute everything that is reported of a camera study, from records and the reference task of each."""
    labels = {BASE: "Base"}
    for share, (reset, middle) in strengths.items():
        end = f" {share:.0%}" if len(strengths) > 1 else ""
        labels |= {reset: f"Reset{end}", middle: f"Mid-task{end}"}
    successes = {
        arm: np.array([record.arm(arm).success for record in records], dtype=np.bool_) for arm in labels
    }
    conditions = Conditions(
        successes,
        source=np.array([record.source for record in records], dtype=np.str_),
        task=np.array(tasks, dtype=np.str_),
        configuration=np.array([record.configuration for record in records], dtype=np.str_),
    )
    return Camera(
        conditions=labels,
        rates={arm: conditions.rate(arm) for arm in labels},
        outcomes=[
            JointOutcome(success=dict(zip(labels, flags, strict=True)), cases=count)
            for flags, count in conditions.joint().items()
        ],
        contrasts=list(contrasts(conditions, _pairs(strengths))),
        gap_contrasts=_gaps(strengths, conditions),
        approach={f"{share:g}": _approach(records, *arms) for share, arms in strengths.items()},
    )


def _pairs(strengths: Strengths) -> list[tuple[str, str]]:
    pairs = [
        pair
        for reset, middle in strengths.values()
        for pair in ((middle, reset), (reset, BASE), (middle, BASE))
    ]
    for weak, strong in combinations(strengths.values(), 2):
        pairs += zip(strong, weak, strict=True)
    return pairs


def _gaps(strengths: Strengths, conditions: Conditions) -> list[ConditionContrast]:
    gap = {share: (middle, reset) for share, (reset, middle) in strengths.items()}
    pairs = list(combinations(strengths, 2))
    gaps = [(gap[strong], gap[weak]) for weak, strong in pairs]
    return list(
        contrasts_of_contrasts(conditions, gaps, [(f"{strong:g}", f"{weak:g}") for weak, strong in pairs])
    )


# Approach of the hand.


class _Case(NamedTuple):
    """Outcomes of a case at a strength."""

    base: bool
    """Base succeeds, as Reset and Mid-task do below."""
    reset: bool
    middle: bool
    entered: bool
    """In Reset the hand came within the trigger's distance."""
    triggered: bool
    """The event fired in Mid-task."""
    responded: bool
    """A query followed it."""
    fresh: bool
    """No stale action was executed."""

    @property
    def lost_in_reset(self) -> bool:
        return self.base and self.middle and not self.reset

    @property
    def lost_in_middle(self) -> bool:
        return self.base and self.reset and not self.middle


_APPROACH: tuple[tuple[str, str, Callable[[_Case], bool]], ...] = (
    ("triggered", "Event fired in Mid-task", lambda it: it.triggered),
    ("query_after_the_event", "... and a query followed it", lambda it: it.responded),
    (
        "reset_failed_never_entered", "Reset fails, the hand never came within the trigger's distance",
        lambda it: not it.reset and not it.entered,
    ),
    (
        "reset_failed_entered", "Reset fails after it came within the distance",
        lambda it: not it.reset and it.entered,
    ),
    (
        "reset_succeeded_never_entered", "Reset succeeds without coming within the distance",
        lambda it: it.reset and not it.entered,
    ),
    (
        "reset_succeeded_entered", "Reset succeeds after it came within the distance",
        lambda it: it.reset and it.entered,
    ),
    ("lost_in_reset", "Base and Mid-task succeed, Reset fails", lambda it: it.lost_in_reset),
    (
        "lost_in_reset_never_entered", "... of these: Reset never came within the distance",
        lambda it: it.lost_in_reset and not it.entered,
    ),
    ("lost_in_middle", "Base and Reset succeed, Mid-task fails", lambda it: it.lost_in_middle),
    (
        "lost_in_middle_with_a_query", "... of these: a query followed the event",
        lambda it: it.lost_in_middle and it.responded,
    ),
    (
        "lost_in_middle_without_stale_actions", "... of these: and no stale action was executed",
        lambda it: it.lost_in_middle and it.responded and it.fresh,
    ),
)  # fmt: skip
"""Names, titles and rules of the counts of cases."""


def _approach(records: Sequence[PairRecord], reset: str, middle: str) -> dict[str, int]:
    cases = [_case(record, record.arm(reset), record.arm(middle)) for record in records]
    return {key: sum(map(rule, cases)) for key, _, rule in _APPROACH}


def _case(record: PairRecord, reset: ArmRecord, middle: ArmRecord) -> _Case:
    return _Case(
        base=record.base_success,
        reset=bool(reset.success),
        middle=bool(middle.success),
        entered=reset.min_distance_m <= _distance_m(record),
        triggered=bool(middle.firings),
        responded=middle.response_step is not None,
        fresh=middle.stale_actions == 0,
    )


def _distance_m(record: PairRecord) -> float:
    schedule = record.arm(DYNAMIC).schedule
    within_m: Any = schedule[0]["trigger"].get("distance_m") if schedule else None
    if type(within_m) not in (int, float) or not 0 <= within_m < float("inf"):
        raise ReportError(
            f"{record.item_id} does not say what its event waits for, so it is of no camera study. Play it "
            "again."
        )
    return float(within_m)


# Tables.


@dataclass(frozen=True)
class _Bootstrap(Interval):
    """The paper's interval, which has no width where all cases of each source are alike."""

    def long(self, value: Bootstrap) -> str:
        return "n/a: all alike" if value.degenerate else interval_text(value, self.signed)


@dataclass(frozen=True)
class _Groups(Interval):
    """An interval over groups of cases."""

    def long(self, value: GroupInterval) -> str:
        if value.withheld:
            return NOT_AVAILABLE
        if value.lower is None:
            return f"too few ({value.groups}, changed {value.changed})"
        return f"{interval_text(value, self.signed)}  {value.groups} groups"


_BOOTSTRAP = "Paper's bootstrap"

_OF_RATE: tuple[Quantity[ConditionRate], ...] = (
    Quantity("success", "All", lambda row: row, Rate()),
    Quantity("bootstrap", _BOOTSTRAP, lambda row: row.bootstrap, _Bootstrap(signed=False)),
)
_OF_CONTRAST: tuple[Quantity[ConditionContrast], ...] = (
    Quantity("gains", "Gain", lambda row: row.gains, Number()),
    Quantity("losses", "Loss", lambda row: row.losses, Number()),
    Quantity("difference", "Difference", lambda row: row, Change()),
    Quantity("bootstrap", _BOOTSTRAP, lambda row: row.bootstrap, _Bootstrap()),
)
_GROUPS = {
    "reference_tasks": "Reference tasks",
    "source_tasks": "Tasks of each source",
    "configurations": "Configurations",
}
"""Headings of the groups of cases."""


def _within(source: str, row: ConditionRate | ConditionContrast) -> Any:
    return row.by_source[source]


def _over_groups(key: str, row: ConditionContrast) -> GroupInterval:
    return row.by_groups[key]


def camera_tables(study: Camera) -> list[Table]:
    """Return the tables of a camera study, in the order in which they are read."""
    labels = study.conditions
    sources = [*next(iter(study.rates.values())).by_source]
    within = [Quantity(name, name, partial(_within, name), Rate()) for name in sources]
    changes = [Quantity(name, name, partial(_within, name), Change()) for name in sources]
    groups = [Quantity(key, title, partial(_over_groups, key), _Groups()) for key, title in _GROUPS.items()]
    named = [(f"{labels[row.first]} - {labels[row.second]}", row) for row in study.contrasts]
    gaps = [
        (f"(Mid-task - Reset) at {float(row.first):.0%} - at {float(row.second):.0%}", row)
        for row in study.gap_contrasts
    ]
    rates = [(label, study.rates[arm]) for arm, label in labels.items()]
    return [
        table_of(
            "Success", "Condition", [_OF_RATE[0], *within, _OF_RATE[1]], rates, narrow=2
        ).explaining_intervals(
            "Exact 95% intervals. The paper's are percentiles of the exact bootstrap distribution with the "
            "composition of the sources kept. They are for comparison with the paper, and far too narrow for "
            "rare outcomes."
        ),
        _joint(study),
        table_of(
            "Paired contrasts",
            "Contrast",
            _OF_CONTRAST,
            named,
            note="Gain: only the first condition succeeds; loss: only the second. Reset and Mid-task differ "
            "in more than the moment: in how long the new view is seen, in the states visited and in the "
            "steps left.",
            narrow=5,
        ).explaining_intervals(
            "The interval of the difference is exact. The paper's resamples cases within each source, and is "
            "too narrow where few differ. Each interval is for itself, without correction for the number of "
            "contrasts."
        ),
        *(
            [table_of("Mid-task less Reset, between strengths", "Contrast", _OF_CONTRAST[2:], gaps)]
            if gaps
            else []
        ),
        table_of(
            "Contrasts by source, and over groups of cases", "Contrast", [*changes, *groups], [*named, *gaps]
        ).explaining_intervals(
            "By source, the same interval as over all cases. Reference tasks are resampled jointly across "
            "the sources, whose shares stay fixed; tasks of each source, and configurations (task and "
            "initial state), within each source. The case-weighted estimate stays the same."
        ),
        _approach_table(study),
    ]


def _joint(study: Camera) -> Table:
    rows = [(*(int(row.success[arm]) for arm in study.conditions), row.cases) for row in study.outcomes]
    left = len(rows) - _LISTED
    return Table(
        "Outcomes together",
        (*study.conditions.values(), "Cases"),
        rows[:_LISTED],
        "1 for a success." + (f" {left} rarer combinations are in report.json." if left > 0 else ""),
    )


def _approach_table(study: Camera) -> Table:
    several = len(study.approach) > 1
    heads = [f"at {float(strength):.0%}" if several else "Number" for strength in study.approach]
    rows = [(title, *(counts[key] for counts in study.approach.values())) for key, title, _ in _APPROACH]
    return Table("Approach", ("Cases", *heads), rows)
