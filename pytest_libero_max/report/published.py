"""Published results on the genuine substrate: reference rows beside one's own, never mixed with them."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.releases import RELEASED, ReleasedFile
from pytest_libero_max.report.formats import percent, points
from pytest_libero_max.runs.protocol import protocol_words
from pytest_libero_max.stats.outcome_table import Outcomes

if TYPE_CHECKING:
    from pytest_libero_max.report.report_document import Report

_MAX, _PRO, _LITE = (
    next(file for file in RELEASED if file.file == name)
    for name in ("libero_max_8000.json", "libero_max_pro_hard_2400.json", "libero_max_lite.json")
)
"""The newest versions of the cases of the published results: all, those of LIBERO-PRO, and those of Lite."""

NOTE = (
    "Published results on the genuine substrate (LIBERO-Plus and LIBERO-PRO). Results of the embedded "
    "substrate are not comparable with them."
)


@dataclass(frozen=True)
class Printed:
    """Values of a policy that the paper prints without their counts: percent and percentage points.

    Attributes:
        family: Paired change by event family. They follow from the event changes, but of fifteen ties the
            paper rounds two towards zero.
        source: By source Base success, Dynamic success and paired change.
        lowest_base: By source the category of lowest Base success.
        largest_loss: By source the category of largest loss.
        macro: Unweighted mean of the paired changes of the 17 source categories.
        suite: Paired change by suite.
        severity: Paired change by severity.
        split_event: Event whose parameter variants differ most in Dynamic success.
        split: That difference.
        lite: Base success, Dynamic success and paired change on the authors' Lite.
    """

    family: Mapping[str, float]
    source: Mapping[str, tuple[float, float, float]]
    lowest_base: Mapping[str, str]
    largest_loss: Mapping[str, str]
    macro: float
    suite: Mapping[str, float]
    severity: Mapping[str, float]
    split_event: str
    split: float
    lite: tuple[float, float, float]


@dataclass(frozen=True)
class PublishedPolicy:
    """One policy of the LIBERO-MAX paper on the 8,000 pairs of Max.

    Attributes:
        key: Short name.
        name: As printed.
        family: ``VLA``, ``WAM`` or ``VLA+WAM``.
        outcomes: The four printed counts.
        net_change: Gained minus regressed pairs of each event, of 1,000.
        scale: Scale that its authors report; None where they report none. All are checkpoints that were
            released for LIBERO, and were not trained for this benchmark.
        printed: Values that are printed without counts.
    """

    key: str
    name: str
    family: str
    horizon: int
    query_interval: int
    outcomes: Outcomes
    net_change: Mapping[str, int]
    scale: str | None
    printed: Printed


@dataclass(frozen=True)
class PartialPolicy:
    """The policy of the paper that has no checkpoint for LIBERO-10, and is in none of its rankings.

    Attributes:
        name: As printed.
        by_suite: Pairs, and printed percentages of Base success, Dynamic success and paired change; None for
            the suite that it does not support.
        total: The same over the supported pairs.
    """

    name: str
    horizon: int
    query_interval: int
    by_suite: Mapping[str, tuple[int, float | None, float | None, float | None]]
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


class Beside(NamedTuple):
    """Published results beside a run of the same cases.

    Attributes:
        note: What they are, or why there are none.
        head: Headings.
        rows: The run, then the published policies; empty where there are none.
    """

    note: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


BESIDE_TITLE = "Published results of the same cases"

_HEAD = ("Policy", "Base success", "Dynamic success", "Paired change, pp", "H", "Q", "Reported scale")


def published_beside(report: Report) -> Beside | None:
    """Return the published results of the cases that a run played; None for cases that are not the authors'.

    They are of the authors' 8,000 cases, recognised by their checksum, or of the 2,400 of LIBERO-PRO or the
    800 of Lite among them. A run that differs from them in anything but its policy has none beside it, and
    the note says why.
    """
    released = report.provenance["case_set"].get("released_as")
    file = next((file for file in (_MAX, _PRO, _LITE) if str(file) == released), None)
    if file is None or not report.pairs.played:
        return None
    lack = lacks_for_published(report.provenance, report.pairs.played, file)
    if lack is not None:
        return Beside(f"None is shown beside this run: {lack}.", _HEAD, ())
    overall, spec = report.overall, report.policy or {}
    own = (
        f"{spec.get('name')} (this run)",
        percent(overall.base_success.value),
        percent(overall.dynamic_success.value),
        points(overall.paired_change.value),
        *(str(spec.get(key)) for key in ("horizon", "query_interval")),
        "",
    )
    return Beside(
        f"As the paper prints them for the {file.cases:,} cases. It counts a pair without a result as a "
        "failure, and this run has none. Policies differ in size, training data and serving; all of them are "
        "checkpoints released for LIBERO, not trained for this benchmark.",
        _HEAD,
        (own, *(_beside(policy, file) for policy in published_policies())),
    )


def _beside(policy: PublishedPolicy, file: ReleasedFile) -> tuple[str, ...]:
    base, dynamic, change = _rates(policy, file)
    protocol = (str(policy.horizon), str(policy.query_interval), policy.scale or "not reported")
    return (policy.name, percent(base), percent(dynamic), points(change), *protocol)


def _rates(policy: PublishedPolicy, file: ReleasedFile) -> tuple[float | None, ...]:
    """Return Base success, Dynamic success and paired change of a policy on some of the authors' cases."""
    if file is _MAX:
        outcomes = policy.outcomes
        return outcomes.base.value, outcomes.dynamic.value, outcomes.change.value
    printed = policy.printed
    return tuple(value / 100 for value in (printed.lite if file is _LITE else printed.source["pro"]))


def lacks_for_published(provenance: Json, played: int, file: ReleasedFile | None = None) -> str | None:
    """Return why published results are not of the cases that a run played; None where they are.

    Args:
        provenance: Provenance of the run.
        played: Number of measured pairs.
        file: The authors' cases that the results are of; by default all 8,000.
    """
    file = file or _MAX
    case_set, substrate = provenance["case_set"], provenance["substrate"]
    asked = {"semantics": "published", "instruction_source": "published", "source_variations": "installed"}
    if case_set.get("released_as") != str(file):
        return f"its cases are {case_set['name']}, not those of {file}"
    if played < file.cases:
        return f"it measured {played:,} of the {file.cases:,} cases"
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
    lines = [
        *textwrap.wrap(NOTE, 100),
        "",
        f"{'policy':<20} {'Base':>8} {'Dynamic':>9} {'change':>9} {'lost':>8} {'H':>4} {'Q':>4}  scale",
    ]
    for policy in published_policies():
        outcomes = policy.outcomes
        lines.append(
            f"{policy.name:<20} {percent(outcomes.base.value):>8} {percent(outcomes.dynamic.value):>9} "
            f"{points(outcomes.change.value):>9} {percent(outcomes.conditional_regression.value):>8} "
            f"{policy.horizon:>4} {policy.query_interval:>4}  {policy.scale or 'not reported'}"
        )
    return lines
