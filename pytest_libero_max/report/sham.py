"""The sham event: losses by the policy's own chance beside the losses by the event."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pytest_libero_max.events.schedules import BASE, DYNAMIC, SHAM, SHAM_DYNAMIC
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report import report_document
from pytest_libero_max.report.formats import change_text, count_text, percent, rate_text
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.measured import (
    mean_difference_of,
    number,
    rate_of,
    ratio_of,
    table_change_of,
)
from pytest_libero_max.stats.outcome_table import tabulate
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio

SHAM_TITLE = "Sham event: other seeds alone"
CHANCE_TITLE = "Flips by chance"
NOT_BEYOND = "The flips are not shown to be more than this policy's own chance makes"


def sham_of(records: Iterable[PairRecord]) -> report_document.Sham | None:
    """Return the outcomes of the sham event beside those of the event; None where none was played."""
    played = [record for record in records if SHAM in record.arms]
    if not played:
        return None
    base = [record.base_success for record in played]
    sham = [bool(record.arms[SHAM].success) for record in played]
    dynamic = [record.dynamic_success for record in played]
    alike = sum(record.arms[SHAM].proof == record.arms[BASE].proof for record in played)
    by_sham, by_event, beyond = tabulate(base, sham), tabulate(base, dynamic), tabulate(sham, dynamic)
    lost, event_lost = by_sham.conditional_regression, by_event.conditional_regression
    gained = Ratio(by_sham.change_associated_success, by_sham.total - by_sham.base.count)
    return report_document.Sham(
        pairs=len(played),
        identical=ratio_of(Ratio(alike, len(played))),
        lost=rate_of(lost),
        gained=rate_of(gained),
        event_lost=rate_of(event_lost),
        beyond=table_change_of(beyond),
        chance=_chance_of([record for record in played if SHAM_DYNAMIC in record.arms]),
    )


def _chance_of(records: Sequence[PairRecord]) -> report_document.Chance | None:
    """Return the flips by chance and beyond it, of pairs with both rollouts played twice.

    With success probabilities b and d after the event, a pair flips with b (1 - d) + d (1 - b), two Bases
    differ with 2 b (1 - b) and two Dynamics with 2 d (1 - d). Flips less the mean of these is (d - b)
    squared, which is the expectation of the product of two independent differences.
    """
    if not records:
        return None
    ends = [
        tuple(bool(record.arms[name].success) for name in (BASE, DYNAMIC, SHAM, SHAM_DYNAMIC))
        for record in records
    ]
    pairs = len(ends)
    flips = Ratio(sum(base != dynamic for base, dynamic, _, _ in ends), pairs)
    bases = Ratio(sum(base != again for base, _, again, _ in ends), pairs)
    dynamics = Ratio(sum(dynamic != again for _, dynamic, _, again in ends), pairs)
    products = [(dynamic - base) * (other - again) for base, dynamic, again, other in ends]
    alike, opposite = products.count(1), products.count(-1)
    return report_document.Chance(
        flips=rate_of(flips),
        base_flips=rate_of(bases),
        dynamic_flips=rate_of(dynamics),
        floor=number((bases.count + dynamics.count) / (2 * pairs)) or 0.0,
        beyond=mean_difference_of(Ratio(alike - opposite, pairs), paired_difference(opposite, alike, pairs)),
    )


def sham_text(report: Report) -> str | None:
    """Return what the sham event showed; None where it was neither asked for nor played."""
    sham = report.sham
    if sham is None:
        asked = report.provenance["protocol"].get("sham")
        return f"asked for on {asked:.0%} of the pairs, and none of these was played" if asked else None
    return (
        f"lost {rate_text(sham.lost)}, by the event {count_text(sham.event_lost)}; Dynamic less sham "
        f"{change_text(sham.beyond)}; {count_text(sham.identical)} bit for bit as Base"
    )


def chance_text(report: Report) -> str | None:
    """Return the flips by chance and beyond it; None where Base and Dynamic were not played twice."""
    chance = None if report.sham is None else report.sham.chance
    if chance is None:
        return None
    text = (
        f"Base and Dynamic end differently in {rate_text(chance.flips)}, two Bases in "
        f"{count_text(chance.base_flips)}, two Dynamics in {count_text(chance.dynamic_flips)}: "
        f"{percent(chance.floor)} by chance, beyond it {change_text(chance.beyond)}"
    )
    repeatable = report.policy is None or report.policy.get("repeatable", True)
    if repeatable and chance.flips.count and chance.beyond.lower is not None and chance.beyond.lower <= 0.0:
        return f"{text}. {NOT_BEYOND}"
    return text


def unrepeatable_texts(report: Report) -> list[str]:
    """Return notes on a policy that draws noise of its own, and on its floor; none for other policies."""
    if report.policy is None or report.policy.get("repeatable", True):
        return []
    sham = report.sham
    measured = (
        "No pair of this run was played twice, so the size of this chance is not known: "
        "--libero-max-noise=sham:1."
        if sham is None or sham.chance is None
        else f"{sham.pairs} of {report.pairs.played} pairs measure it."
    )
    texts = [
        "NOT REPEATABLE: this policy draws noise that no seed of ours sets, so that a pair may end "
        "otherwise when it is played again. Paired changes are not biased by it, but lost and gained pairs "
        f"hold this chance as well as the event. {measured}"
    ]
    return texts if sham is None or sham.chance is None else texts + _floor_texts(sham.chance)


def _floor_texts(chance: report_document.Chance) -> list[str]:
    """Return a sentence that calls a floor as large as the effect so; none for a smaller floor."""
    flips, beyond = chance.flips, chance.beyond
    if not (flips.count or chance.floor) or beyond.lower is None or beyond.lower > 0.0:
        return []
    seen = (
        f"of {flips.of} pairs that were played twice, Base and Dynamic end differently in "
        f"{percent(flips.value)}, and two plays of the same arm in {percent(chance.floor)}."
    )
    reading = "read the paired change with its interval, and no single pair."
    if chance.floor >= (flips.value or 0.0):
        return [
            f"THE FLOOR IS AS LARGE AS THE EFFECT ON SINGLE PAIRS: {seen} This policy's own chance alone "
            f"makes as many lost and gained pairs: {reading}"
        ]
    return [
        f"THE FLOOR MAY BE AS LARGE AS THE EFFECT ON SINGLE PAIRS: {seen} What is beyond chance, "
        f"{change_text(beyond)}, is not shown to be above 0: {reading}"
    ]
