"""A published run: its packed pairs, from which every report follows, and its report in Markdown."""

from __future__ import annotations

import gzip
from pathlib import Path

from pytest_libero_max.benchmark.documents import read_content
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.writers.markdown import markdown
from pytest_libero_max.report.writers.report_files import MARKDOWN_NAME, make_folder, report_of, write_bytes
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, pairs_file, read_pairs


def publish(run: Path, folder: Path) -> list[Path]:
    """Write the packed pairs of a finished run and its report in Markdown.

    The same pairs give the same files.

    Args:
        run: The output folder of the run.
        folder: Made where it is missing. Files of these names are replaced.

    Raises:
        ReportError: The run cannot be read or is not complete, or the files cannot be written.
    """
    stored = read_pairs(run)
    report = report_of(stored)
    if not report.pairs.complete:
        raise ReportError(
            f"{run} is incomplete: {report.headline.reason}. Continue it with --libero-max-resume."
        )
    files = {MARKDOWN_NAME: markdown(report).encode()}
    try:
        files[PACKED_PAIRS_NAME] = gzip.compress(read_content(pairs_file(run)), mtime=0)
    except OSError as error:
        raise ReportError(f"Cannot read the pairs of {run}: {error}.") from error
    make_folder(folder)
    for name, content in files.items():
        write_bytes(folder / name, content)
    return [folder / name for name in files]
