"""The files of a comparison: JSON, Markdown, figures, and a page that needs no network."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_plots import (
    COMPARISON_PLOTS,
    event_changes,
    outcome_shares,
    success_differences,
)
from pytest_libero_max.report.comparison.comparison_sections import document_of, with_short_names
from pytest_libero_max.report.formats import interval_text, points
from pytest_libero_max.report.page.comparison_cases import beside, comparison_cases
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.page_frame import document_page
from pytest_libero_max.report.plots import COLOURS_NOTE, direction
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.writers.report_files import make_folder, report_json, write_drawings, write_text
from pytest_libero_max.runs.store import pairs_file

COMPARISON_CAPTIONS = {stem: caption for stem, (_, caption) in COMPARISON_PLOTS.items()}
"""Captions of the figures."""


def write_comparison(comparison: Comparison, folder: Path, common: CommonCases | None = None) -> list[Path]:
    """Write ``comparison.json``, ``comparison.md``, ``comparison.html`` and the figures.

    Args:
        folder: Made where it is missing.
        common: The cases that were compared, of runs named by their paths. The page then has a table of
            them, shows their films, and links to the pages of the runs.

    Returns:
        The files. The figures are SVG, and PNG as well where the extra ``figures`` is installed.

    Raises:
        ReportError: They cannot be written.
    """
    files = {
        "comparison.json": report_json(comparison),
        "comparison.md": comparison_markdown(comparison),
        "comparison.html": comparison_html(comparison, common, folder),
    }
    make_folder(folder)
    for name, content in files.items():
        write_text(folder / name, content)
    return [*(folder / name for name in files), *write_drawings(comparison_figures(comparison), folder)]


def comparison_markdown(comparison: Comparison) -> str:
    """Return a comparison as Markdown, with the figures beside it."""
    return document_markdown(document_of(comparison), COMPARISON_CAPTIONS)


def comparison_figures(comparison: Comparison) -> dict[str, str]:
    """Return the SVG documents of a comparison by the stem of their file name, its runs named briefly."""
    shown = with_short_names(replace(comparison, flips=[]))
    return {stem: drawn(plot(shown)) for stem, (plot, _) in COMPARISON_PLOTS.items()}


def comparison_html(
    comparison: Comparison, common: CommonCases | None = None, folder: Path | None = None
) -> str:
    """Render a comparison as a page.

    Args:
        common: The cases that were compared, of runs named by their paths; None leaves their table out.
        folder: Folder of the page; by default the working directory.
    """
    shown = with_short_names(replace(comparison, flips=[]))
    cases = None
    if common is not None:
        names = [run.name for run in comparison.runs]
        cases = comparison_cases(
            common,
            dict(zip(names, (run.name for run in shown.runs), strict=True)),
            {run.name: run.replay for run in comparison.runs},
            beside({name: pairs_file(Path(name)).parent for name in names}, folder or Path()),
        )
    return document_page(
        "comparison.html",
        document_of(comparison),
        cases,
        headline=_headline(shown) if len(shown.runs) == 2 else None,
        plot=success_differences(shown) if len(shown.runs) == 2 else event_changes(shown),
        colours_note=COLOURS_NOTE,
        shares=outcome_shares(shown).rows,
        events=[] if common is None else events_of(common.planned),
    )


def _headline(comparison: Comparison) -> tuple[str, str, str, str]:
    """Return the difference of two runs in Dynamic success: number, interval, class of its colour, words."""
    (contrast,) = comparison.contrasts
    difference = contrast.difference
    kind = direction(difference)
    words = {
        "loss": f"{contrast.second} succeeds less often than {contrast.first} when the event happens.",
        "gain": f"{contrast.second} succeeds more often than {contrast.first} when the event happens.",
        "neutral": "No difference is shown: the interval holds 0.",
    }
    return f"{points(difference.value)} pp", interval_text(difference, signed=True), kind, words[kind]
