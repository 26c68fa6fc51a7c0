"""The main numbers of a report under flat names, for experiment trackers."""

from __future__ import annotations

from msgspec.structs import asdict

from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import main_measures
from pytest_libero_max.stats.blocks import Change, Measure, Rate, Result


def main_numbers(report: Report) -> dict[str, float]:
    """Pairs and outcomes; rates, changes and numbers of sections with their intervals, and rates by event.

    A run that is incomplete has counts, and no rates: it has no score.
    """
    pairs, overall = report.pairs, report.overall
    found: dict[str, float | None] = {
        "pairs/played": pairs.played,
        "pairs/invalid": pairs.invalid,
        "pairs/missing": pairs.missing,
    }
    found |= {f"outcomes/{name}": count for name, count in asdict(overall.outcomes).items()}
    if pairs.complete:
        for name, block in _main(overall).items():
            found |= _with_ends(name, block)
        for _, measure in main_measures(report):
            found |= _with_ends(f"sections/{measure.key}", measure)
        for event, row in report.by["event"].items():
            found |= {f"events/{event}/{name}": block.value for name, block in _main(row).items()}
    return {name: value for name, value in found.items() if value is not None}


def _with_ends(name: str, block: Rate | Change | Measure) -> dict[str, float | None]:
    return {name: block.value, f"{name}_lower": block.lower, f"{name}_upper": block.upper}


def _main(row: Result) -> dict[str, Rate | Change]:
    return {
        "base_success": row.base_success,
        "dynamic_success": row.dynamic_success,
        "paired_change": row.paired_change,
    }
