"""The files of a finished run, computed from its ``pairs.jsonl`` and from nothing else."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from pytest_libero_max.benchmark.structs import decode_json, shown
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.comparison_document import Comparison
from pytest_libero_max.report.gate_text import gate_rows
from pytest_libero_max.report.gates import GateResult
from pytest_libero_max.report.groups import DIMENSIONS
from pytest_libero_max.report.page.case_table import run_cases
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.render.drawing import drawn, survival_curves
from pytest_libero_max.report.report_document import REPORT_VERSION, Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_plots import RUN_PLOTS
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.writers import raster
from pytest_libero_max.runs.lock import require_ended
from pytest_libero_max.runs.media import VIEWS, films_in, pictures_in
from pytest_libero_max.runs.replay_command import replay_command
from pytest_libero_max.runs.store import StoredRun, pairs_file, read_pairs
from pytest_libero_max.stats.blocks import Block

REPORT_NAME = "report.json"
MARKDOWN_NAME = "report.md"
HTML_NAME = "report.html"


def report_of(stored: StoredRun) -> Report:
    """Return the report of a run as read from disk."""
    return build_report(
        stored.records, stored.errors, stored.run.planned, stored.run.provenance, stored.stopped
    )


def write_reports(
    folder: Path,
    amend: Callable[[Report], Report] | None = None,
    on_problem: Callable[[str], object] | None = None,
    gates: Sequence[GateResult] = (),
    earlier: Comparison | None = None,
) -> tuple[Report, list[Path]]:
    """Compute the report of the run in ``folder`` and write it beside its pairs.

    Args:
        on_problem: Called for each file that cannot be made or written. None: the first one is an error.

    Returns:
        The report, and the files to look at: the pairs, ``report.json``, ``report.md`` and ``report.html``.

    Raises:
        ReportError: The pairs cannot be read, or the files not be written.
    """
    stored = read_pairs(folder)
    report = report_of(stored)
    if amend is not None:
        report = amend(report)
    files: dict[str, Callable[[], str]] = {
        REPORT_NAME: lambda: report_json(report),
        MARKDOWN_NAME: lambda: markdown(report, films_in(folder), gate_rows(gates)),
        HTML_NAME: lambda: run_page(report, stored, folder, gates, earlier),
    }
    written = [pairs_file(folder)]
    for name, text in files.items():
        try:
            write_text(folder / name, text())
        except Exception as error:
            if on_problem is None:
                raise
            on_problem(str(error) if isinstance(error, ReportError) else f"No {name}: {error!r}")
        else:
            written.append(folder / name)
    return report, written


def run_page(
    report: Report,
    stored: StoredRun,
    folder: Path,
    gates: Sequence[GateResult] = (),
    earlier: Comparison | None = None,
) -> str:
    """Return the content of ``report.html``, with links to films and pictures in the run's folder."""
    regressions = sorted(record.item_id for record in stored.records if record.outcome == "regression")
    films: dict[str, list[str]] = {}
    for view in VIEWS:
        for item, film in films_in(folder, view).items():
            films.setdefault(item, []).append(film)
    measured = {record.item_id for record in stored.records}
    films = {item: films[item] for item in sorted(measured & films.keys())}
    cases = run_cases(stored, films, pictures_in(folder), folder)
    name, replay = pairs_file(folder).name, replay_command(stored)
    return html(report, regressions, replay, films, stored, cases, name, gate_rows(gates), earlier)


def write_figures(report: Report, folder: Path) -> list[Path]:
    """Write the figures of a report into an existing folder, see :func:`write_drawings`."""
    return write_drawings(all_figures(report), folder)


def all_figures(report: Report) -> dict[str, str]:
    """Return the SVG documents of a report by the stem of their file name, those of its study included.

    Without a played pair there is nothing to draw.
    """
    if not report.pairs.played:
        return {}
    figures = {stem: drawn(plot(report)) for stem, plot in RUN_PLOTS.items()}
    figures["time-to-success"] = survival_curves(report.success_curves)
    return figures | study_figures(report.study)


def write_drawings(documents: Mapping[str, str], folder: Path) -> list[Path]:
    """Write SVG documents by the stem of their file name, as PNG as well where the extra is installed."""
    files = {f"{stem}.svg": svg.encode() for stem, svg in documents.items()}
    if raster.available():
        files |= {f"{stem}.png": raster.png_of(svg) for stem, svg in documents.items()}
    for name, content in files.items():
        write_bytes(folder / name, content)
    return [folder / name for name in files]


def report_json(report: Block) -> str:
    """Return the content of ``report.json`` or another document: fields in their order, a final newline."""
    return json.dumps(msgspec.to_builtins(report), indent=1, allow_nan=False) + "\n"


def read_report(path: Path) -> Report:
    """Read a ``report.json`` (or the one in a folder).

    Raises:
        ReportError: It is missing, is not a report, or is of another schema version.
    """
    if path.is_dir():
        path = path / REPORT_NAME
    require_ended(path.parent)
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        raise ReportError(
            f"Cannot read {path}: {error}. Give a report.json or the folder of a run."
        ) from error
    try:
        report: Any = decode_json(content, "Compute it again from its pairs.jsonl.")
    except ReportError as error:
        raise ReportError(f"{path}: {error}") from error
    version = report.get("schema_version") if isinstance(report, dict) else None
    if version != REPORT_VERSION:
        raise ReportError(
            f"{path} has schema_version={version!r}, but this version reads {REPORT_VERSION}. "
            "Compute it again from its pairs.jsonl."
        )
    try:
        read = msgspec.convert(report, Report)
        if read.by.keys() != DIMENSIONS.keys():
            raise msgspec.ValidationError(f"by has the groups {shown([*read.by])}, not {[*DIMENSIONS]}")
    except msgspec.ValidationError as error:
        raise ReportError(f"{path} is damaged: {error}. Compute it again from its pairs.jsonl.") from error
    return read


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ReportError(f"Cannot make {folder}: {error}. Give a folder you can write to.") from error


def write_text(path: Path, text: str) -> None:
    """Write a file so that a reader sees the old content or the new, never half of it."""
    write_bytes(path, text.encode(errors="backslashreplace"))  # a name may hold what UTF-8 does not know


def write_bytes(path: Path, content: bytes) -> None:
    """:func:`write_text` for any content."""
    partial = path.with_name(path.name + ".partial")
    try:
        partial.unlink(missing_ok=True)  # it may be a link, which writing would follow
        with partial.open("xb") as file:
            file.write(content)
        os.replace(partial, path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise ReportError(f"Cannot write {path}: {error}. Give a folder you can write to.") from error
