"""The sham event: losses by the policy's own chance beside the losses by the event."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_libero_max.events.schedules import BASE, SHAM
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report import report_document
from pytest_libero_max.report.formats import change_text, count_text, rate_text
from pytest_libero_max.report.measured import mean_difference_of, rate_of, ratio_of
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.stats.outcome_table import Ratio, tabulate
from pytest_libero_max.stats.paired_difference import paired_difference

SHAM_TITLE = "Sham event: other seeds alone"


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
    exact = paired_difference(beyond.regression, beyond.change_associated_success, beyond.total)
    return report_document.Sham(
        pairs=len(played),
        identical=ratio_of(Ratio(alike, len(played))),
        lost=rate_of(lost),
        gained=rate_of(gained),
        event_lost=rate_of(event_lost),
        beyond=mean_difference_of(beyond.change, exact),
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
