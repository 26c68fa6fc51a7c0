"""Published results on the genuine substrate: reference rows beside one's own, never mixed with them."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.releases import RELEASED, ReleasedFile
from pytest_libero_max.report.document import Table, table_of
from pytest_libero_max.report.formats import Percent, Tenths
from pytest_libero_max.report.quantities import TEXT, Quantity
from pytest_libero_max.report.render.terminal import WIDTH, table_lines
from pytest_libero_max.runs.protocol import protocol_words
from pytest_libero_max.stats.blocks import Outcomes
from pytest_libero_max.stats.ratios import Ratio

if TYPE_CHECKING:
    from pytest_libero_max.report.report_document import Report

_MAX, _PRO, _LITE = (
    next(file for file in RELEASED if file.file == name)
    for name in ("libero_max_8000.json", "libero_max_pro_hard_2400.json", "libero_max_lite.json")
)
"""The newest versions of the cases of the published results: all, those of LIBERO-PRO, and those of Lite."""

NOTE = (
    "Published results on genuine scenes (LIBERO-Plus and LIBERO-PRO). Results on embedded scenes are not "
    "comparable with them."
)


@dataclass(frozen=True)
class Printed:
    """Values of a policy that the paper prints without their counts: percent and percentage points."""

    family: Mapping[str, float]
    """Paired change by event family. They follow from the event changes, but of fifteen ties the paper rounds
    two towards zero."""
    source: Mapping[str, tuple[float, float, float]]
    """By source Base success, Dynamic success and paired change."""
    lowest_base: Mapping[str, str]
    """By source the category of lowest Base success."""
    largest_loss: Mapping[str, str]
    macro: float
    suite: Mapping[str, float]
    severity: Mapping[str, float]
    split_event: str
    split: float
    lite: tuple[float, float, float]
    """Base success, Dynamic success and paired change on the authors' Lite."""


@dataclass(frozen=True)
class PublishedPolicy:
    """One policy of the LIBERO-MAX paper on the 8,000 pairs of Max."""

    key: str
    name: str
    family: str
    """``VLA``, ``WAM`` or ``VLA+WAM``."""
    horizon: int
    query_interval: int
    outcomes: Outcomes
    net_change: Mapping[str, int]
    """Gained minus regressed pairs of each event, of 1,000."""
    scale: str | None
    """Scale that its authors report; None where they report none. All are checkpoints that were released for
    LIBERO, and were not trained for this benchmark."""
    printed: Printed


@dataclass(frozen=True)
class PartialPolicy:
    """The policy of the paper that has no checkpoint for LIBERO-10, and is in none of its rankings."""

    name: str
    horizon: int
    query_interval: int
    by_suite: Mapping[str, tuple[int, float | None, float | None, float | None]]
    """Pairs, and printed percentages of Base success, Dynamic success and paired change; None for the suite
    that it does not support."""
    total: tuple[int, float, float, float]


def published_policies() -> tuple[PublishedPolicy, ...]:
    """Return the fourteen policies in the order of the paper's main table."""
    return tuple(
        PublishedPolicy(
            **{**row, "outcomes": Outcomes(**row["outcomes"]), "printed": Printed(**row["printed"])}
        )
        for row in _document()["policies"]
    )


def published_partial() -> PartialPolicy:
    """Return the policy that the paper lists apart."""
    return PartialPolicy(**_document()["partial"])


def authors_cases() -> dict[str, int]:
    """Return the number of cases of the authors' Max by suite."""
    cases: dict[str, int] = _document()["cases_by_suite"]
    return cases


def published_file(provenance: Mapping[str, Any]) -> ReleasedFile | None:
    """Return the authors' cases that a run played, of those with published results; None for others."""
    released = provenance["case_set"].get("released_as")
    return next((file for file in (_MAX, _PRO, _LITE) if str(file) == released), None)


def published_success(policy: PublishedPolicy, file: ReleasedFile, arm: Literal["base", "dynamic"]) -> Ratio:
    """Return the successes of a published policy on some of the authors' cases.

    The paper prints counts for all of them. For a part it prints the rate to 0.1 points; the count is the
    nearest one, which for Lite's 800 cases is the only one with this rate.
    """
    if file is _MAX:
        counts: Ratio = getattr(policy.outcomes, arm)
        return counts
    shares = policy.printed.lite if file is _LITE else policy.printed.source["pro"]
    share = shares[("base", "dynamic").index(arm)]
    return Ratio(round(share * file.cases / 100), file.cases)


BESIDE_TITLE = "Published results of the same cases"


class _Row(NamedTuple):
    """A policy with its rates and its protocol."""

    name: str
    base: float | None
    dynamic: float | None
    change: float | None
    horizon: int | None
    query_interval: int | None
    scale: str
    lost: float | None = None
    key: str = ""

    @classmethod
    def of(cls, policy: PublishedPolicy, file: ReleasedFile) -> _Row:
        printed, rates = policy.printed, policy.outcomes
        base, dynamic, change = rates.base.value, rates.dynamic.value, rates.change.value
        if file is not _MAX:
            shares = printed.lite if file is _LITE else printed.source["pro"]
            base, dynamic, change = (value / 100 for value in shares)
        scale, lost = policy.scale or "not reported", rates.conditional_regression.value
        protocol = policy.horizon, policy.query_interval
        return cls(policy.name, base, dynamic, change, *protocol, scale, lost, policy.key)


_RATES: tuple[Quantity[_Row], ...] = (
    Quantity("base_success", "Base success", lambda row: row.base, Percent()),
    Quantity("dynamic_success", "Dynamic success", lambda row: row.dynamic, Percent()),
    Quantity("paired_change", "Paired change, pp", lambda row: row.change, Tenths()),
)
_LOST: Quantity[_Row] = Quantity("lost", "Lost", lambda row: row.lost, Percent())
_KEY: Quantity[_Row] = Quantity("key", "Row", lambda row: row.key, TEXT)
_PROTOCOL: tuple[Quantity[_Row], ...] = (
    Quantity("horizon", "H", lambda row: row.horizon, TEXT),
    Quantity("query_interval", "Q", lambda row: row.query_interval, TEXT),
    Quantity("scale", "Reported scale", lambda row: row.scale, TEXT),
)


def published_beside(report: Report) -> Table | None:
    """Return the published results of the cases that a run played; None for cases that are not the authors'.

    They are of the authors' 8,000 cases, recognised by their checksum, or of the 2,400 of LIBERO-PRO or the
    800 of Lite among them. A run that differs from them in anything but its policy has none beside it, and
    the note says why.
    """
    file = published_file(report.provenance)
    if file is None or not report.pairs.played:
        return None
    lack = lacks_for_published(report.provenance, report.pairs.played, file)
    if lack is not None:
        note = f"None is shown beside this run: {lack}."
        return table_of(BESIDE_TITLE, "Policy", (*_RATES, *_PROTOCOL), (), note=note)
    overall, spec = report.overall, report.policy or {}
    own = _Row(
        f"{spec.get('name')} (this run)",
        overall.base_success.value,
        overall.dynamic_success.value,
        overall.paired_change.value,
        spec.get("horizon"),
        spec.get("query_interval"),
        "",
    )
    rows = [own, *(_Row.of(policy, file) for policy in published_policies())]
    return table_of(
        BESIDE_TITLE,
        "Policy",
        (*_RATES, *_PROTOCOL),
        [(row.name, row) for row in rows],
        note=f"As the paper prints them for the {file.cases:,} cases. It counts a pair without a result as a "
        "failure, and this run has none. Policies differ in size, training data and serving; all of them are "
        "checkpoints released for LIBERO, not trained for this benchmark.",
    )


def lacks_for_published(provenance: Json, played: int, file: ReleasedFile | None = None) -> str | None:
    """Return why published results are not of the cases that a run played; None where they are.

    Args:
        file: The authors' cases that the results are of; by default all 8,000.
    """
    file = file or _MAX
    case_set, substrate = provenance["case_set"], provenance["substrate"]
    if "source_variations" not in substrate:
        return f"its scenes are {substrate['name']}, not those of LIBERO-Plus and LIBERO-PRO"
    asked = {"semantics": "published", "instruction_source": "published", "source_variations": "installed"}
    if case_set.get("released_as") != str(file):
        return f"its cases are {case_set['name']}, not those of {file}"
    if played < file.cases:
        return f"it has {played:,} of the {file.cases:,} cases"
    extra = protocol_words(provenance["protocol"])
    if extra:
        return f"it played another protocol ({', '.join(extra)})"
    other = [name for name, value in asked.items() if substrate.get(name) != value]
    return f"its {' and '.join(other)} are not as published" if other else None


def _document() -> Json:
    text = resources.files("pytest_libero_max.report").joinpath("published.json").read_text(encoding="utf-8")
    document: Json = json.loads(text)
    return document


def published_lines() -> list[str]:
    """Return the published results as a table for the terminal, under a line with their origin."""
    rows = [(policy.name, _Row.of(policy, _MAX)) for policy in published_policies()]
    table = table_of("", "Policy", (_KEY, *_RATES, _LOST, *_PROTOCOL), rows)
    return [*textwrap.wrap(NOTE, WIDTH), "", *table_lines(table)]
