"""A comparison of runs as tables, which the terminal and the page print in their own ways."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from pytest_libero_max.report.blocks import Result
from pytest_libero_max.report.comparison.comparison_document import (
    ApartRun,
    ChangeContrast,
    Comparison,
    EventContrasts,
    GroupContrast,
    GroupDifference,
    SuccessContrast,
)
from pytest_libero_max.report.formats import PairCount, interval_text, p_number, percent, points
from pytest_libero_max.report.table import Table
from pytest_libero_max.stats.intervals import Interval
from pytest_libero_max.stats.verdicts import WORDS, word_for

AnyContrast = SuccessContrast | ChangeContrast | GroupContrast

APART = (
    "Listed apart: policies that do not support all suites of the others. Their rows are over the cases that "
    "they support, and they change nothing else here. --restrict compares all runs on the cases they share."
)

MEANINGS = f"Verdicts: {'; '.join(f'{word}, {meaning}' for word, meaning in WORDS.items())}."

EVENT = "Event"
"""Heading of a column that names events."""

_LEVEL = 0.05
_SIMULTANEOUS = "Simultaneous 95%"


def contrast_tables(comparison: Comparison) -> Iterator[Table]:
    """Yield the contrasts of every two runs, those by event, and how far the runs agree about the events."""
    family = len(comparison.contrasts)
    notes = [
        "The test of a paired change takes the two runs as exchangeable. Its interval does not, and may hold "
        "0 where p is small.",
        MEANINGS,
    ]
    if family > 1:
        notes.insert(
            0,
            f"All {family} intervals of a table together hold the differences with 95% (Bonferroni). Holm's "
            "p is corrected for as many tests and is a little sharper: it may be below 0.05 where the "
            "interval still holds 0.",
        )
    yield contrast_table("Dynamic success", comparison.contrasts)
    yield contrast_table("Base success", comparison.base_contrasts)
    yield contrast_table("Paired change", comparison.change_contrasts, " ".join(notes))
    yield from _by_event(comparison)
    yield from _profiles(comparison)


def contrast_table(quantity: str, contrasts: Sequence[AnyContrast], note: str = "") -> Table:
    """Return the contrasts of every two runs in one quantity."""
    interval = _SIMULTANEOUS if len(contrasts) > 1 else "95%"
    head = ("Second against first", "Difference, pp", interval, "95% by task", "Holm p", "Verdict")
    rows = [
        (f"{one.second} against {one.first}", *_cells(one), _verdict(one, len(contrasts)))
        for one in contrasts
    ]
    return Table(f"{quantity}, contrasts", head, rows, note)


def _cells(contrast: AnyContrast) -> tuple[str, ...]:
    difference, log10_p = contrast.difference, contrast.log10_p_value_holm
    cells = [points(difference.value), interval_text(difference.simultaneous, signed=True)]
    if not isinstance(difference, GroupDifference):
        by_task = difference.by_task
        cells.append("n/a" if by_task is None else interval_text(by_task, signed=True))
    return (*cells, "n/a" if log10_p is None else p_number(log10_p))


def _verdict(contrast: AnyContrast, family: int) -> str:
    """Return the word for a contrast of one of so many."""
    found, log10_p = contrast.difference.simultaneous, contrast.log10_p_value_holm
    if found.lower is None or found.upper is None or log10_p is None:
        return "n/a"
    differing = None
    if isinstance(contrast, SuccessContrast):
        differing = contrast.first_only + contrast.second_only
    return word_for(log10_p, Interval(found.lower, found.upper), differing, comparisons=family)


def _by_event(comparison: Comparison) -> Iterator[Table]:
    """Yield the contrasts by event: each for two runs, those with a small p counted for more."""
    quantities: tuple[tuple[str, Callable[[EventContrasts], list[GroupContrast]]], ...] = (
        ("Dynamic success", lambda contrasts: contrasts.dynamic_success),
        ("Paired change", lambda contrasts: contrasts.paired_change),
    )
    note = "Holm's correction and the simultaneous intervals are over all events and pairs of runs."
    for title, quantity in quantities:
        found = {event: quantity(contrasts) for event, contrasts in comparison.by_event.items()}
        if len(comparison.runs) == 2:
            head: tuple[str, ...] = (EVENT, "Difference, pp", _SIMULTANEOUS, "Holm p")
            rows = [(event, *_cells(contrast)) for event, (contrast,) in found.items()]
        else:
            head = (EVENT, f"Contrasts with Holm p < {_LEVEL:g}")
            rows = [(event, _small(contrasts)) for event, contrasts in found.items()]
        yield Table(f"{title} by event, contrasts", head, rows, note)


def _small(contrasts: Sequence[GroupContrast]) -> str:
    tested = [one.log10_p_value_holm for one in contrasts if one.log10_p_value_holm is not None]
    return f"{sum(10**log10_p < _LEVEL for log10_p in tested)} of {len(tested)}"


def _profiles(comparison: Comparison) -> Iterator[Table]:
    """Yield the paired changes by event over several runs, and the lowest one of each run."""
    if len(comparison.runs) > 2:
        over_runs = [
            (
                event,
                points(found.median),
                f"[{points(found.lower_quartile)}, {points(found.upper_quartile)}]",
                f"[{points(found.lowest)}, {points(found.highest)}]",
            )
            for event, found in comparison.events.items()
        ]
        head = (EVENT, "Median, pp", "Quartiles", "Range")
        yield Table("Paired change by event over the runs", head, over_runs)
    if len(comparison.by_event) > 1:
        rows = [
            (
                run.name,
                points(run.lowest_event.value),
                points(run.lowest_event.by_chance),
                run.lowest_event.event or "none stands out",
            )
            for run in comparison.runs
        ]
        profiles = comparison.event_profiles
        note = "Agreement of the event profiles: n/a, no two runs have profiles that vary."
        if profiles.mean_spearman is not None:
            note = (
                f"Agreement of the event profiles (Spearman): mean {profiles.mean_spearman:.2f}, from "
                f"{profiles.lowest:.2f} to {profiles.highest:.2f} over the pairs of runs."
            )
        title = "Lowest paired change of an event"
        yield Table(title, ("Run", "Value, pp", "By chance, pp", "Event"), rows, note)


def apart_tables(runs: Iterable[ApartRun]) -> Iterator[Table]:
    """Yield the runs that are listed apart: by suite, and over all that the policy supports, as in the paper.

    A suite that the policy does not support has no result.
    """
    head = ("Pairs", "Base success", "Dynamic success", "Paired change, pp")
    for run in runs:
        by_suite = {**run.by_suite, **dict.fromkeys(run.unsupported_suites)}
        results = [*sorted(by_suite.items()), ("all supported", run.result)]
        yield Table(run.name, (run.name, *head), [_apart(name, result) for name, result in results])


def _apart(name: str, row: Result | None) -> tuple[str, ...]:
    if row is None:
        return (name, "unsupported", "n/a", "n/a", "n/a")
    change = f"{points(row.paired_change.value)} {interval_text(row.paired_change, signed=True)}"
    rates = (percent(row.base_success.value), percent(row.dynamic_success.value))
    return (name, PairCount().short(row), *rates, change)
