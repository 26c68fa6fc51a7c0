"""Published results on the genuine substrate: reference rows beside one's own, never mixed with them."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.stats.outcome_table import Outcomes

NOTE = (
    "Published results on the genuine substrate (LIBERO-Plus and LIBERO-PRO). Results of the embedded "
    "substrate are not comparable with them."
)


@dataclass(frozen=True)
class PublishedPolicy:
    """One policy of the LIBERO-MAX paper on the 8,000 pairs of Max.

    Attributes:
        key: Short name.
        name: As printed.
        family: ``VLA``, ``WAM`` or ``VLA+WAM``.
        outcomes: The four printed counts.
        net_change: Gained minus regressed pairs of each event, of 1,000.
    """

    key: str
    name: str
    family: str
    horizon: int
    query_interval: int
    outcomes: Outcomes
    net_change: Mapping[str, int]


def published_policies() -> tuple[PublishedPolicy, ...]:
    """Return the fourteen policies in the order of the paper's main table."""
    text = resources.files("pytest_libero_max.report").joinpath("published.json").read_text(encoding="utf-8")
    return tuple(
        PublishedPolicy(**{**row, "outcomes": Outcomes(**row["outcomes"])})
        for row in json.loads(text)["policies"]
    )


def published_lines() -> list[str]:
    """Return the published results as a table for the terminal, under a line with their origin."""
    lines = [
        *textwrap.wrap(NOTE, 100),
        "",
        f"{'policy':<20} {'Base':>8} {'Dynamic':>9} {'change':>9} {'lost':>8}",
    ]
    for policy in published_policies():
        outcomes = policy.outcomes
        lines.append(
            f"{policy.name:<20} {percent(outcomes.base.value):>8} {percent(outcomes.dynamic.value):>9} "
            f"{points(outcomes.change.value):>9} {percent(outcomes.conditional_regression.value):>8}"
        )
    return lines
