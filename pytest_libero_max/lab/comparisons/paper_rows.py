"""Policies as rows of the tables for a paper: from one's own runs, and from the published results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.build import extremes_of, group_order, split_of
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.published import PublishedPolicy
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.stats.blocks import Outcomes
from pytest_libero_max.stats.breakdown import macro_average
from pytest_libero_max.stats.measured import tabulate
from pytest_libero_max.stats.paired import Pairs
from pytest_libero_max.stats.ratios import Ratio


@dataclass(frozen=True)
class Rates:
    """Success of a group of pairs; None for what is not known."""

    pairs: int | None
    base: float | None
    """Base success rate, 0 to 1."""
    dynamic: float | None
    """Dynamic success rate, 0 to 1."""
    change: float | None
    """Paired change, -1 to 1."""

    @classmethod
    def of(cls, outcomes: Outcomes) -> Rates:
        """Return the rates of a group that was counted."""
        return cls(outcomes.total, outcomes.base.value, outcomes.dynamic.value, outcomes.change.value)

    @classmethod
    def printed(
        cls, pairs: int | None, base: float | None, dynamic: float | None, change: float | None
    ) -> Rates:
        """Return rates from percent and percentage points as printed."""
        return cls(pairs, *(None if value is None else value / 100 for value in (base, dynamic, change)))


@dataclass(frozen=True)
class PolicyRow:
    """One policy in the tables."""

    name: str
    published: bool
    """True for results of the paper."""
    horizon: int | None
    """H, the chunk size."""
    query_interval: int | None
    """Q, the execution horizon."""
    outcomes: Outcomes
    by: Mapping[str, Mapping[str, Rates]]
    """Rates by dimension (see :data:`~pytest_libero_max.report.groups.DIMENSIONS`) and group."""
    macro: float | None
    """Unweighted mean of the paired changes of the source categories."""
    lowest_base: Mapping[str, str]
    """By source the category of lowest Base success."""
    largest_loss: Mapping[str, str]
    """By source the category of largest loss."""
    split: tuple[str, float] | None
    """Event whose parameter variants differ most in Dynamic success, and that difference."""
    family: str | None = None
    """Kind of the policy, and the scale that its authors report; None for one's own."""
    scale: str | None = None
    lite: Rates | None = None
    """Rates on the cases of Lite; None where these are not a part of the cases."""
    trigger: Ratio | None = None
    """Pairs whose event fired; None where it is not published."""
    response: Ratio | None = None
    """Pairs with a query after the event; None where it is not published."""
    with_interval: bool = True
    """False for a run that a rule stopped, which has no interval of a fixed number of pairs."""


def row_of(
    name: str, policy: Json | None, planned: Sequence[PlannedPair], pairs: Pairs, lite: frozenset[str]
) -> PolicyRow:
    """Return the row of a run.

    Args:
        policy: The policy's spec as played.
        planned: The cases, in the order of their outcomes in ``pairs``.
        lite: Ids of the cases of Lite; empty where they are not among the cases.
    """
    counted: dict[str, dict[str, Outcomes]] = {}
    for dimension in ("event", "family", "suite", "source", "category", "severity", "variant"):
        labels = np.asarray([DIMENSIONS[dimension].label(pair) for pair in planned])
        groups = sorted({*labels.tolist()}, key=lambda group: group_order(dimension, group))
        counted[dimension] = {
            group: tabulate(pairs.base[labels == group], pairs.dynamic[labels == group]) for group in groups
        }
    extremes, split = extremes_of(counted["category"]), split_of(counted["variant"])
    in_lite = np.asarray([pair.case_id in lite for pair in planned])
    return PolicyRow(
        name=name,
        published=False,
        horizon=None if policy is None else policy["horizon"],
        query_interval=None if policy is None else policy["query_interval"],
        outcomes=tabulate(pairs.base, pairs.dynamic),
        by={
            dimension: {group: Rates.of(cell) for group, cell in groups.items()}
            for dimension, groups in counted.items()
        },
        macro=macro_average([*counted["category"].values()]).paired_change,
        lowest_base={source: found.lowest_base_success for source, found in extremes.items()},
        largest_loss={source: found.largest_loss for source, found in extremes.items()},
        split=None if split is None else (split.event, split.difference or 0.0),
        lite=Rates.of(tabulate(pairs.base[in_lite], pairs.dynamic[in_lite])) if lite else None,
        trigger=Ratio(int(pairs.triggered.sum()), len(pairs)),
        response=Ratio(int(pairs.responded.sum()), len(pairs)),
    )


def published_row(policy: PublishedPolicy) -> PolicyRow:
    """Return the row of a published policy: from its counts, and else from what the paper prints."""
    printed, per_event = policy.printed, policy.outcomes.total // len(policy.net_change)

    def changes(by_group: Mapping[str, float]) -> dict[str, Rates]:
        return {group: Rates.printed(None, None, None, change) for group, change in by_group.items()}

    return PolicyRow(
        name=policy.name,
        published=True,
        family=policy.family,
        scale=policy.scale,
        horizon=policy.horizon,
        query_interval=policy.query_interval,
        outcomes=policy.outcomes,
        by={
            "event": {
                event: Rates(per_event, None, None, net / per_event)
                for event, net in policy.net_change.items()
            },
            "family": changes(printed.family),
            "source": {source: Rates.printed(None, *values) for source, values in printed.source.items()},
            "suite": changes(printed.suite),
            "severity": changes(printed.severity),
        },
        macro=printed.macro / 100,
        lowest_base=printed.lowest_base,
        largest_loss=printed.largest_loss,
        split=(printed.split_event, printed.split / 100),
        lite=Rates.printed(None, *printed.lite),
    )
