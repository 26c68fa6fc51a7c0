"""``libero-max report``: the report of a run, computed again from its pairs."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, option, switch
from pytest_libero_max.cli.terminal import say_coloured
from pytest_libero_max.report.exports import EXPORTS

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import GateResult
    from pytest_libero_max.report.readers import ResultsReader
    from pytest_libero_max.report.report_document import Report


def add_command(commands: Commands) -> None:
    """Add ``report`` to the parser."""
    report = commands.add_parser(
        "report", help="Compute the report of a run again from its pairs.jsonl alone"
    )
    report.add_argument("folder", type=Path, metavar="FOLDER", help="The output folder of the run")
    option(
        report,
        "--gate CONDITION",
        "Show the verdict on this gate; may be repeated (default: libero_max_gate of the ini file). "
        "No verdict changes the exit status; libero-max gate has one",
        many=True,
    )
    switch(report, "--figures", "Also write the figures, as SVG and (with the extra figures) PNG")
    switch(report, "--tables", "Also write the tables as CSV and LaTeX")
    switch(report, "--badge", "Also write badge.json, which a badge of shields.io can show")
    option(
        report,
        "--export FORMAT=FILE",
        "Instead, write the run in the format of another tool: "
        f"{', '.join(EXPORTS) or 'none is installed'}; FILE is a folder where the format has several files. "
        "May be repeated",
        many=True,
        type=_export_named,
    )
    option(
        report,
        "--cases TRACK|FILE",
        "Cases of results that another runner wrote (default: the authors' Lite)",
    )
    option(
        report,
        "--beside RUN",
        "Compare Dynamic success with this run, of results that another runner wrote; for a run of this "
        "package there is libero-max compare",
        type=Path,
    )
    report.set_defaults(run=_report)


def _export_named(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not equals or not file:
        raise argparse.ArgumentTypeError(f"{text!r}, but must be FORMAT=FILE, for example tensorboard=logs")
    return name, Path(file)


def _export(options: argparse.Namespace) -> None:
    from pytest_libero_max.cli.ini_file import gates_of
    from pytest_libero_max.report.exports import ExportedRun
    from pytest_libero_max.report.gate_results import decide_on
    from pytest_libero_max.report.writers.report_files import report_of
    from pytest_libero_max.runs.store import read_pairs

    stored = read_pairs(options.folder)
    gates, start = gates_of(options.gate, Path.cwd())
    verdicts = decide_on(gates, stored, report_of(stored), start) if gates else ()
    run = ExportedRun(options.folder, stored, verdicts)
    for format_name, place in options.export:
        print(f"Written: {', '.join(map(str, EXPORTS[format_name](run, place)))}")


def rewrite(folder: Path, asked: Sequence[str] = ()) -> tuple[Report, list[Path], tuple[GateResult, ...]]:
    """Write the report of a run again; return it, the files to look at, and the verdicts on gates."""
    from pytest_libero_max.cli.ini_file import gates_of
    from pytest_libero_max.report.gate_results import decide
    from pytest_libero_max.report.writers.report_files import write_reports

    gates, start = gates_of(asked, Path.cwd())
    verdicts = decide(gates, folder, start) if gates else ()
    report, paths = write_reports(folder, gates=verdicts)
    return report, paths, verdicts


def run_summary(folder: Path, report: Report, paths: Sequence[Path]) -> list[str]:
    """Return the summary of a run in a folder, with its films and the files that were written."""
    from pytest_libero_max.report.broken import to_look_at
    from pytest_libero_max.report.writers.summary import summary_lines
    from pytest_libero_max.runs.media import MOST_FILMS, films_in, show_command

    films = {item: str(folder / film) for item, film in films_in(folder).items()}
    show = show_command(folder, str(folder), to_look_at(report, MOST_FILMS), report.provenance)
    return summary_lines(report, [str(path) for path in paths], films, show)


def _refuse_options_of_results(options: argparse.Namespace) -> None:
    """Refuse what is for results of other runners alone."""
    from pytest_libero_max.errors import OptionError

    for name in ("cases", "beside"):
        if getattr(options, name) is not None:
            raise OptionError(
                f"--{name} is for results that another runner wrote, but {options.folder} holds none that is "
                "known. Leave it out; libero-max compare compares runs."
            )


def _report_results(options: argparse.Namespace, reader: ResultsReader) -> None:
    """Write the report of results that another runner wrote."""
    from pytest_libero_max.cli.ini_file import gates_of
    from pytest_libero_max.report.formats import interval_text, points
    from pytest_libero_max.report.gate_text import gate_lines
    from pytest_libero_max.report.read_results import (
        contrast_with,
        decide_results,
        report_of_results,
        write_results,
    )
    from pytest_libero_max.report.writers.summary import summary_lines
    from pytest_libero_max.runs.outcomes import read_outcomes

    results = reader.read(options.folder, options.cases)
    gates, _ = gates_of(options.gate, Path.cwd())
    verdicts = decide_results(gates, report_of_results(results)) if gates else ()
    report, paths = write_results(options.folder, results, verdicts)
    for note in results.notes:
        print(textwrap.fill(note, 100))
    say_coloured(summary_lines(report, [str(path) for path in paths]))
    if verdicts:
        say_coloured(gate_lines(verdicts))
    if options.beside is not None:
        contrast = contrast_with(results, read_outcomes(options.beside))
        if isinstance(contrast, str):
            print(f"Beside {options.beside}: {contrast}.")
        else:
            change = contrast.difference
            print(
                f"Beside {options.beside}, over {contrast.cases} common cases: Dynamic success of the run is "
                f"{points(change.value)} pp {interval_text(change, signed=True)} beside these results; "
                f"{contrast.first_only} succeed here alone, {contrast.second_only} in the run alone."
            )


def _report(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.gate_text import gate_lines
    from pytest_libero_max.report.readers import reader_of
    from pytest_libero_max.report.run_tables import csv_text, latex_text
    from pytest_libero_max.report.writers import raster
    from pytest_libero_max.report.writers.badge import BADGE_NAME, badge_json
    from pytest_libero_max.report.writers.report_files import write_figures, write_text

    if options.export:
        _export(options)
        return
    if (reader := reader_of(options.folder)) is not None:
        _report_results(options, reader)
        return
    _refuse_options_of_results(options)
    report, paths, verdicts = rewrite(options.folder, options.gate)
    if options.figures:
        paths += write_figures(report, options.folder)
    if options.tables:
        tables = {"report.csv": csv_text(report), "report.tex": latex_text(report)}
        for name, text in tables.items():
            write_text(options.folder / name, text)
        paths += [options.folder / name for name in tables]
    if options.badge:
        write_text(options.folder / BADGE_NAME, badge_json(report))
        paths.append(options.folder / BADGE_NAME)
    say_coloured(run_summary(options.folder, report, paths))
    if verdicts:
        say_coloured(gate_lines(verdicts))
    if options.figures and not raster.available():
        print(f"Figures are SVG only; for PNG as well: {raster.INSTALL}")
