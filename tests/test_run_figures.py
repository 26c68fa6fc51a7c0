"""Figures of published runs in prose: each is computed again from the pairs of the runs."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.lab.recovery import compare_recovery
from pytest_libero_max.lab.sections.safety import PROBE, beyond
from pytest_libero_max.lab.studies.camera.blocks import Camera
from pytest_libero_max.report.formats import (
    change_text,
    count_text,
    interval_text,
    percent,
    points,
    rate_text,
)
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.store import StoredRun, read_pairs
from pytest_libero_max.stats.blocks import Rate
from pytest_libero_max.stats.measured import rate_of, table_change_of, tabulate
from pytest_libero_max.stats.ratios import Ratio
from tests.scripts.interaction import interaction

REPORTS = Path(__file__).parents[1] / "reports"
PAGES = [page for page in sorted(REPORTS.rglob("*.md")) if page.name not in ("report.md", "comparison.md")]


@cache
def run(name: str) -> StoredRun:
    return read_pairs(REPORTS / name)


@cache
def report(name: str) -> Report:
    return report_of(run(name))


def prose(page: str) -> str:
    return " ".join((REPORTS / page).read_text(encoding="utf-8").split())


def shared_arms(one: str, other: str) -> tuple[int, int, int]:
    """Number of arms that two runs share, of those with equal proofs, and of pairs with equal ones."""
    second = {record.case_id: record for record in run(other).records}
    pairs = [
        [
            record.arms[name].proof == second[record.case_id].arms[name].proof
            for name in record.arms.keys() & second[record.case_id].arms.keys()
        ]
        for record in run(one).records
        if record.case_id in second
    ]
    return sum(map(len, pairs)), sum(map(sum, pairs)), sum(map(all, pairs))


def equality_of_safety() -> Iterator[str]:
    arms, equal, _ = shared_arms("safety/learned", "learned/lite")
    yield (
        "Proofs and outcomes of Base and Dynamic are those of [its run of `lite`](learned/lite/report.md) in "
        f"{equal} of {arms} arms."
    )


def equality_of_studies() -> Iterator[str]:
    arms, equal, _ = shared_arms("studies/camera-timing", "studies/camera-strength")
    assert arms == equal
    timing = shared_arms("studies/camera-timing", "servo/lite")[2]
    cadence = shared_arms("studies/cadence-servo", "servo/lite")[2]
    yield (
        f"the proofs of the {arms:,} arms that camera timing and camera strength share, of {timing} pairs of "
        f"camera timing and `lite`, and of {cadence} pairs of the cadence sweep and `lite` are equal."
    )
    arms, equal, _ = shared_arms("studies/event-timing-stale_expert", "lite/stale_expert")
    yield f"of `lite` in {equal:,} of {arms:,} arms."


def safety_rows() -> Iterator[str]:
    for name, title in (("safety/expert", "`expert`"), ("safety/learned", "learned")):
        records = run(name).records
        overall = report(name).overall
        unsafe = beyond(1.0)
        ends = [
            [bool(record.arms[arm].success) and unsafe(record.arms[arm].probes[PROBE]) for record in records]
            for arm in (BASE, DYNAMIC)
        ]
        table = tabulate(*ends)
        change = table_change_of(table)
        cells = [
            title,
            str(len(records)),
            str(overall.base_success.count),
            str(overall.dynamic_success.count),
            *(counted_rate(rate_of(rate)) for rate in (table.base, table.dynamic)),
            f"{points(change.value)} pp {interval_text(change, signed=True)}",
        ]
        yield f"| {' | '.join(cells)} |"


def counted_rate(rate: Rate) -> str:
    return f"{rate.count} = {percent(rate.value)} {interval_text(rate)}"


def camera(name: str) -> Camera:
    study = report(f"studies/{name}").study
    assert study is not None
    assert isinstance(study.camera, Camera)
    return study.camera


def camera_timing_rows() -> Iterator[str]:
    study = camera("camera-timing")
    for arm, title in (
        ("base", "Base"),
        ("reset", "Reset: the camera stands elsewhere from the start"),
        ("dynamic", "Mid-task: it moves when the hand is within 18 cm"),
    ):
        rate = study.rates[arm]
        yield f"| {title} | {count_text(rate)} = {percent(rate.value)} {interval_text(rate)} |"
    for row in study.contrasts:
        names = [study.conditions[name] for name in (row.first, row.second)]
        group = row.by_groups["configurations"]
        cells = (
            " - ".join(names),
            f"{row.gains}, {row.losses}",
            f"{points(row.value)} {interval_text(row, signed=True)}",
            interval_text(group, signed=True),
        )
        yield f"| {' | '.join(cells)} |"


def camera_strength_rows() -> Iterator[str]:
    study = camera("camera-strength")
    arms = [name for name in study.rates if name != "base"]
    for share, reset, middle in zip(study.approach, arms[::2], arms[1::2], strict=True):
        row = next(one for one in study.contrasts if (one.first, one.second) == (middle, reset))
        cells = (
            f"{float(share):.0%}",
            *(counted_rate(study.rates[arm]) for arm in (reset, middle)),
            f"{points(row.value)} {interval_text(row, signed=True)}",
        )
        yield f"| {' | '.join(cells)} |"


def event_timing_rows() -> Iterator[str]:
    studies = [report(f"studies/event-timing-{policy}").study for policy in ("stale_expert", "servo")]
    for arm, title in (
        ("base", "Base"),
        ("reset", "Reset: the event has happened before the first query"),
        ("dynamic", "Dynamic: it happens while the policy acts"),
    ):
        rates = [study.arms[arm] for study in studies if study is not None and study.arms is not None]
        cells = [f"{count_text(rate)} = {percent(rate.value)} {interval_text(rate)}" for rate in rates]
        yield f"| {title} | {' | '.join(cells)} |"


def cadence_rows() -> Iterator[str]:
    for name in ("cadence-servo", "cadence-stale_expert"):
        study = report(f"studies/{name}").study
        assert study is not None
        for row in study.settings:
            change = f"{points(row.paired_change.value)} {interval_text(row.paired_change, signed=True)}"
            rates = " | ".join(map(count_text, (row.base_success, row.dynamic_success)))
            yield f"{'its own | ' if row.own else ' | '}{rates} | {change} | {row.stale_actions.mean:.1f} |"


def recovery_rows() -> Iterator[str]:
    modes = ("native", "always", "gated")
    recovery = compare_recovery([run(f"studies/recovery-{mode}") for mode in modes])
    for row in recovery.effects:
        if (row.quantity, row.over) == ("dynamic", "native"):
            ends = " | ".join(interval_text(one, signed=True) for one in (row, row.bootstrap))
            yield f"| {row.mode} - native | {points(row.value)} | {ends} | {row.gained}, {row.lost} |"


def interaction_of_compound() -> Iterator[str]:
    found = interaction(run("beyond/compound-servo").records)
    yield f"is {change_text(found)}"
    yield f"it is below zero in {found.losses} cases and above it in {found.gains}"


CLAIMS: tuple[tuple[str, Callable[[], Iterator[str]]], ...] = (
    ("beyond.md", interaction_of_compound),
    ("safety.md", equality_of_safety),
    ("safety.md", safety_rows),
    ("studies/README.md", equality_of_studies),
    ("studies/README.md", camera_timing_rows),
    ("studies/README.md", camera_strength_rows),
    ("studies/README.md", event_timing_rows),
    ("studies/README.md", cadence_rows),
    ("studies/README.md", recovery_rows),
)


@pytest.mark.parametrize(("page", "claims"), CLAIMS, ids=[claims.__name__ for _, claims in CLAIMS])
def test_a_page_says_what_the_pairs_say(page: str, claims: Callable[[], Iterator[str]]) -> None:
    assert [claim for claim in claims() if " ".join(claim.split()) not in prose(page)] == []


_RATE = re.compile(r"\b(\d[\d,]*)/(\d[\d,]*) = ([\d.]+%) (\[[\d.]+, [\d.]+\])")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPORTS)))
def test_an_interval_behind_counts_is_the_exact_one(page: Path) -> None:
    wrong = []
    for found in _RATE.finditer(page.read_text(encoding="utf-8")):
        count, of = (int(number.replace(",", "")) for number in found.groups()[:2])
        rate = rate_of(Ratio(count, of))
        if f"{percent(rate.value)} {interval_text(rate)}" != f"{found[3]} {found[4]}":
            wrong.append((found[0], rate_text(rate)))
    assert wrong == []
