"""Make what is published below ``reports`` again from its pairs: ``python -m tests.report.publish_again``.

Needed after a change of Markdown, pages, figures or statistics; then also ``tests.report.page.first_screen``.
"""

from __future__ import annotations

import os
from pathlib import Path

from pytest_libero_max.cli import main
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
from pytest_libero_max.report.comparison.compare_files import write_comparison
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.writers.report_files import HTML_NAME, report_of, run_page
from pytest_libero_max.runs.media import films_in
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, read_pairs

REPORTS = Path(__file__).parents[2] / "reports"


INDEX, CHECKS = REPORTS / "index.html", REPORTS / "verified.json"


def publish_again() -> None:
    """Write every published report and comparison, and their index."""
    for page in sorted(REPORTS.rglob("report.md")):
        stored = read_pairs(page.parent / PACKED_PAIRS_NAME)
        report = report_of(stored)
        page.write_text(markdown(report, films_in(page.parent)), encoding="utf-8")
        if (whole := page.with_name(HTML_NAME)).is_file():
            whole.write_text(run_page(report, stored, page.parent), encoding="utf-8")
        for stem, svg in study_figures(report.study).items():
            if (figure := page.with_name(f"{stem}.svg")).is_file():
                figure.write_text(svg, encoding="utf-8")
    for folder in sorted(path.parent for path in REPORTS.rglob("comparison.md")):
        os.chdir(folder)  # the page names the runs by their ways from it
        published = {path.name for path in folder.iterdir() if path.is_file()}
        runs = read_runs(sorted(Path(path.name) for path in folder.iterdir() if path.is_dir()))
        for path in write_comparison(compare_runs(runs), Path(), common_cases(runs)):
            if path.name not in published:
                path.unlink()
    main(["publish", "index", str(REPORTS), f"--output={INDEX}", f"--verified={CHECKS}"])


if __name__ == "__main__":
    publish_again()
