"""The files of a comparison: JSON, Markdown, HTML and figures."""

from __future__ import annotations

from pathlib import Path

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.report.comparison.compare import CommonCases
from pytest_libero_max.report.comparison.compare_figures import CAPTIONS, drawn
from pytest_libero_max.report.comparison.compare_html import comparison_html
from pytest_libero_max.report.comparison.compare_text import comparison_title, result_lines
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.comparison.run_notes import CAVEATS_TITLE, caveats_by_run
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.writers.markdown import markdown_text
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
    results, fence = "\n".join(map(printable, result_lines(comparison))), "```"
    while fence in results:
        fence += "`"
    parts = [f"# {markdown_text(comparison_title(comparison))}", f"{fence}text\n{results}\n{fence}"]
    parts += [f"![{caption}]({stem}.svg)\n\n{caption}" for stem, caption in CAPTIONS.items()]
    if caveats := caveats_by_run(comparison):
        parts += [f"## {CAVEATS_TITLE}", "\n".join(f"- {markdown_text(text)}" for text in caveats)]
    parts += [f"## {LIMITS_TITLE}", "\n".join(f"- {text}" for text in comparison.statements.values())]
    return "\n\n".join(parts) + "\n"
