"""Connection of a run with a row of the paper: success less the published success of the same cases."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError, counted, did_you_mean
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.report.published import (
    PublishedPolicy,
    lacks_for_published,
    published_file,
    published_policies,
    published_success,
)
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.intervals import Interval
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.two_proportions import compare_proportions

Arm = Literal["base", "dynamic"]

ARMS: Mapping[str, Arm] = {"base_sr_vs_published": "base", "dynamic_sr_vs_published": "dynamic"}
"""Arm by the gate quantity: largest end, without its sign, of the interval of success less that of a row."""

CONFIDENCE = 0.9
"""Both ends inside a margin are two one-sided tests at 5%."""

MARGIN = 0.05
"""Margin of the line that a report has without being asked, where the profile of the policy names a row."""


@dataclass(frozen=True)
class Connection:
    """Success of a run beside that of a row of the paper, on the same cases."""

    policy: str
    arm: Arm
    own: Ratio
    published: Ratio
    """As printed. The paper prints counts for all 8,000 cases, and rates to 0.1 points for parts of them."""

    @property
    def interval(self) -> Interval:
        """The melded exact 90% interval of the difference.

        It takes the two runs as independent. They played the same cases, so that it is wider than it need be.
        """
        return _interval(self.own, self.published)

    @property
    def largest(self) -> float:
        """Largest end of the interval, without its sign."""
        return max(-self.interval.lower, self.interval.upper)

    def verdict(self, margin: float) -> str:
        """Return ``connected``, ``not connected`` or ``not shown to be connected`` within a margin."""
        if self.largest < margin:
            return "connected"
        apart = self.interval.lower >= margin or self.interval.upper <= -margin
        return "not connected" if apart else "not shown to be connected"


@lru_cache(maxsize=64)
def _interval(own: Ratio, published: Ratio) -> Interval:
    interval = compare_proportions(own, published, CONFIDENCE).interval
    assert interval is not None  # both have cases
    return interval


def published_row(key: str) -> PublishedPolicy:
    """Return the row of the paper with a key."""
    rows = {policy.key: policy for policy in published_policies()}
    if key not in rows:
        raise OptionError.seen(
            "published row", key, f": the paper has no such row. {did_you_mean(key, rows)}"
        )
    return rows[key]


def connect(report: Report, key: str, arm: Arm) -> Connection | str:
    """Return the connection of a run with a row of the paper; a text says why there is none."""
    spec = report.policy or {}
    lack = lack_of_connection(report.provenance, report.pairs.played, key, spec.get("query_interval"))
    if lack is not None:
        return lack
    row, file = published_row(key), published_file(report.provenance)
    assert file is not None
    return Connection(row.name, arm, getattr(report.overall.outcomes, arm), published_success(row, file, arm))


def lack_of_connection(
    provenance: Json, played: int, key: str, query_interval: int | None = None
) -> str | None:
    """Return why a run cannot be held against a row of the paper; None where it can."""
    lack = lacks_for_published(provenance, played, published_file(provenance))
    row = published_row(key)
    if lack is None and query_interval is not None and query_interval != row.query_interval:
        return (
            f"it executes {counted(query_interval, 'action')} of each answer (Q), the published row "
            f"{row.name} executes {row.query_interval}"
        )
    return lack


def can_connect(provenance: Json, key: str, arm: Arm, margin: float) -> bool:
    """Return True if a run of the authors' cases with the very rate of the row would be connected with it."""
    file = published_file(provenance)
    assert file is not None
    published = published_success(published_row(key), file, arm)
    return Connection("", arm, published, published).largest < margin


def connection_texts(report: Report) -> Iterator[str]:
    """Yield a line for each arm of a run whose profile names a row of the paper, if they can be compared."""
    key = report.provenance["policy"].get("published")
    if key is None:
        return
    for arm in ARMS.values():
        connection = connect(report, key, arm)
        if isinstance(connection, str):
            return
        own, published, interval = connection.own, connection.published, connection.interval
        yield (
            f"{arm.capitalize()} {percent(own.value)}, published {percent(published.value)} "
            f"({connection.policy}): {connection.verdict(MARGIN)} within {points(MARGIN).lstrip('+')} points "
            f"(difference [{points(interval.lower)}, {points(interval.upper)}], 90%)."
        )
