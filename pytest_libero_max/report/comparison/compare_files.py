"""The files of a comparison: JSON, Markdown, HTML and figures."""

from __future__ import annotations

from pathlib import Path

from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.compare_figures import CAPTIONS, drawn
from pytest_libero_max.report.comparison.compare_html import comparison_html
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.comparison_sections import document_of
from pytest_libero_max.report.render.markdown import document_markdown
from pytest_libero_max.report.writers.report_files import make_folder, report_json, write_drawings, write_text


def write_comparison(comparison: Comparison, folder: Path, common: CommonCases | None = None) -> list[Path]:
    """Write ``comparison.json``, ``comparison.md``, ``comparison.html`` and the figures.

    Args:
        comparison: Result of :func:`~pytest_libero_max.report.comparison.compare.compare_runs`.
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
    return [*(folder / name for name in files), *write_drawings(drawn(comparison), folder)]


def comparison_markdown(comparison: Comparison) -> str:
    """Return a comparison as Markdown, with the figures beside it."""
    return document_markdown(document_of(comparison), CAPTIONS)
