"""Contrasts of a comparison as tables of a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple
from urllib.parse import urlencode

from pytest_libero_max.report.comparison.compare_text import MEANINGS, AnyContrast, names_of, verdict_of
from pytest_libero_max.report.comparison.comparison_document import (
    Comparison,
    EventContrasts,
    GroupContrast,
    GroupDifference,
)
from pytest_libero_max.report.formats import interval_text, p_number, points
from pytest_libero_max.report.page.page_frame import Viewed

_LEVEL = 0.05
_SIMULTANEOUS = "Simultaneous 95%"


class Contrasts(NamedTuple):
    """A table.

    Attributes:
        title: Heading.
        head: Headings of the columns.
        rows: Cells; the first one names the row.
        note: Text below; empty for none.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""


def contrast_tables(comparison: Comparison) -> Iterator[Contrasts]:
    """Yield the contrasts of every two runs, those by event, and how far the runs agree about the events."""
    families: tuple[tuple[str, Sequence[AnyContrast]], ...] = (
        ("Dynamic success", comparison.contrasts),
        ("Base success", comparison.base_contrasts),
        ("Paired change", comparison.change_contrasts),
    )
    several = len(comparison.contrasts) > 1
    head = (
        "Second against first",
        "Difference, pp",
        _SIMULTANEOUS if several else "95%",
        "95% by task",
        "Holm p",
        "Verdict",
    )
    together = (
        f"All {len(comparison.contrasts)} intervals together hold the differences with 95% (Bonferroni). "
        "Holm's p is corrected for as many tests and is a little sharper."
    )
    for title, contrasts in families:
        rows = [
            (names_of(contrast), *_cells(contrast), verdict_of(contrast, len(contrasts)) or "n/a")
            for contrast in contrasts
        ]
        note = together if several and contrasts is comparison.change_contrasts else ""
        if contrasts is comparison.change_contrasts:
            note = f"{note} {MEANINGS}".strip()
        yield Contrasts(f"{title}, contrasts", head, rows, note)
    yield from _by_event(comparison)
    yield from _profiles(comparison)


def _cells(contrast: AnyContrast) -> tuple[str, ...]:
    difference, log10_p = contrast.difference, contrast.log10_p_value_holm
    cells = [points(difference.value), interval_text(difference.simultaneous, signed=True)]
    if not isinstance(difference, GroupDifference):
        by_task = difference.by_task
        cells.append("n/a" if by_task is None else interval_text(by_task, signed=True))
    return (*cells, "n/a" if log10_p is None else p_number(log10_p))


def _by_event(comparison: Comparison) -> Iterator[Contrasts]:
    """Yield the contrasts by event: each for two runs, those with a small p counted for more."""
    quantities: tuple[tuple[str, Callable[[EventContrasts], list[GroupContrast]]], ...] = (
        ("Dynamic success", lambda contrasts: contrasts.dynamic_success),
        ("Paired change", lambda contrasts: contrasts.paired_change),
    )
    note = "Holm's correction and the simultaneous intervals are over all events and pairs of runs."
    for title, quantity in quantities:
        found = {_event(event): quantity(contrasts) for event, contrasts in comparison.by_event.items()}
        if len(comparison.runs) == 2:
            head: tuple[str, ...] = ("Event", "Difference, pp", _SIMULTANEOUS, "Holm p")
            rows = [(event, *_cells(contrast)) for event, (contrast,) in found.items()]
        else:
            head = ("Event", f"Contrasts with Holm p < {_LEVEL:g}")
            rows = [(event, f"{_small(contrasts)} of {len(contrasts)}") for event, contrasts in found.items()]
        yield Contrasts(f"{title} by event, contrasts", head, rows, note)


def _event(event: str) -> Viewed:
    return Viewed(event, urlencode({"event": event}))


def _small(contrasts: Sequence[GroupContrast]) -> int:
    return sum(10 ** (contrast.log10_p_value_holm or 0.0) < _LEVEL for contrast in contrasts)


def _profiles(comparison: Comparison) -> Iterator[Contrasts]:
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
        found = comparison.event_profiles
        note = "Agreement of the event profiles: n/a, no two runs have profiles that vary."
        if found.mean_spearman is not None:
            note = (
                f"Agreement of the event profiles (Spearman): mean {found.mean_spearman:.2f}, from "
                f"{found.lowest:.2f} to {found.highest:.2f} over the pairs of runs."
            )
        title = "Lowest paired change of an event"
        yield Contrasts(title, ("Run", "Value, pp", "By chance, pp", "Event"), rows, note)
