"""Commands on the results of runs: report, compare, merge, plan."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add the commands: ``report``, ``compare``, ``recovery``, ``publish`` and those that follow."""
    report = commands.add_parser(
        "report", help="Compute the report of a run again from its pairs.jsonl alone"
    )
    report.add_argument("folder", type=Path, metavar="FOLDER", help="The output folder of the run")
    report.add_argument(
        "--figures",
        action="store_true",
        help="Also write the figures, as SVG and (with the extra figures) PNG",
    )
    report.add_argument("--tables", action="store_true", help="Also write the tables as CSV and LaTeX")
    report.add_argument(
        "--badge", action="store_true", help="Also write badge.json, which a badge of shields.io can show"
    )
    report.set_defaults(run=_report)

    compare = commands.add_parser(
        "compare", help="Compare runs on the cases they share, and list what flipped"
    )
    compare.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="The output folders of two or more runs"
    )
    compare.add_argument(
        "--restrict", action="store_true", help="Compare on common cases where the runs have different ones"
    )
    compare.add_argument(
        "--flips", type=int, default=20, metavar="N", help="Listed at most (default: %(default)s)"
    )
    compare.add_argument("--json", type=Path, metavar="FILE", help="Also write the comparison here")
    compare.add_argument(
        "--output",
        type=Path,
        metavar="FOLDER",
        help="Also write the comparison here as JSON, Markdown and HTML, with its figures",
    )
    compare.set_defaults(run=_compare)

    recovery = commands.add_parser(
        "recovery", help="Compare runs of one policy with and without restoration of its images"
    )
    recovery.add_argument(
        "folders",
        type=Path,
        nargs="+",
        metavar="FOLDER",
        help="The output folders of runs with --libero-max-restore=native, always and gated, in any order",
    )
    recovery.add_argument(
        "--restrict", action="store_true", help="Compare on common cases where the runs have different ones"
    )
    recovery.add_argument("--json", type=Path, metavar="FILE", help="Also write the numbers here")
    recovery.set_defaults(run=_recovery)

    publish = commands.add_parser(
        "publish", help="Write packed pairs, report and figures of a run into a folder to be published"
    )
    publish.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    publish.add_argument("folder", type=Path, metavar="FOLDER", help="For example reports/lite/expert")
    publish.set_defaults(run=_publish)

    published = commands.add_parser("published", help="Print the results published in the paper")
    published.set_defaults(run=_published)

    merge = commands.add_parser(
        "merge", help="Join the runs of shards into one; exit status 11 where pairs are missing"
    )
    merge.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="The output folders of the shards"
    )
    merge.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="Where the joined run is written"
    )
    merge.add_argument(
        "--finished",
        action="store_true",
        help="Leave out the folders whose run has not ended or not begun, and say which; may be done again "
        "when more have ended",
    )
    merge.set_defaults(run=_merge)

    gate = commands.add_parser(
        "gate", help="Decide gates on a stored run; exit status 10 where one does not hold, 11 if incomplete"
    )
    gate.add_argument("folder", type=Path, metavar="FOLDER", help="The output folder of the run")
    gate.add_argument(
        "--gate",
        action="append",
        default=[],
        metavar="CONDITION",
        help="For example 'dynamic_sr >= 0.6'; may be repeated (default: libero_max_gate of the ini file)",
    )
    gate.set_defaults(run=_gate)

    power = commands.add_parser(
        "power", help="What each track can resolve, and how many pairs a change needs"
    )
    known = power.add_mutually_exclusive_group(required=True)
    known.add_argument(
        "--run", type=Path, dest="folder", metavar="FOLDER", help="Expect what this run measured"
    )
    known.add_argument("--base", type=float, metavar="RATE", help="Expected Base success, 0 to 1")
    power.add_argument(
        "--gain",
        type=float,
        default=0.01,
        metavar="RATE",
        help="Expected share of pairs that are gained by chance, and lost by chance (default: %(default)s)",
    )
    power.add_argument(
        "--change",
        type=float,
        metavar="CHANGE",
        help="A paired change to resolve, for example -0.05, or 0.05 for a gain",
    )
    power.set_defaults(run=_power)


def _report(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.studies.study_tables import study_csv
    from pytest_libero_max.report.writers import raster
    from pytest_libero_max.report.writers.badge import BADGE_NAME, badge_json
    from pytest_libero_max.report.writers.files import write_figures, write_reports, write_text
    from pytest_libero_max.report.writers.summary import summary_lines
    from pytest_libero_max.report.writers.tables import csv_text, latex_text

    report, paths = write_reports(options.folder)
    if options.figures:
        paths += write_figures(report, options.folder)
    if options.tables:
        tables = {"report.csv": csv_text(report), "report.tex": latex_text(report)}
        if "study" in report:
            tables["study.csv"] = study_csv(report["study"])
        for name, text in tables.items():
            write_text(options.folder / name, text)
        paths += [options.folder / name for name in tables]
    if options.badge:
        write_text(options.folder / BADGE_NAME, badge_json(report))
        paths.append(options.folder / BADGE_NAME)
    print("\n".join(summary_lines(report, [str(path) for path in paths])))
    if options.figures and not raster.available():
        print(f"Figures are SVG only; for PNG as well: {raster.INSTALL}")


def _compare(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
    from pytest_libero_max.report.comparison.compare_files import write_comparison
    from pytest_libero_max.report.comparison.compare_text import comparison_lines
    from pytest_libero_max.report.writers.files import report_json, write_text

    runs = read_runs(options.folders)
    comparison = compare_runs(runs, options.restrict)
    if options.json:
        write_text(options.json, report_json(comparison))
    if options.output:
        write_comparison(comparison, options.output, common_cases(runs, options.restrict))
    print("\n".join(comparison_lines(comparison, options.flips)))


def _recovery(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.studies.recovery import recovery_of
    from pytest_libero_max.report.studies.recovery_text import recovery_lines
    from pytest_libero_max.report.writers.files import report_json, write_text

    recovery = recovery_of(options.folders, options.restrict)
    if options.json:
        write_text(options.json, report_json(recovery))
    print("\n".join(recovery_lines(recovery)))


def _publish(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.publication import publish

    print(f"Written: {', '.join(map(str, publish(options.run_folder, options.folder)))}")


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))


def _merge(options: argparse.Namespace) -> int:
    from pytest_libero_max.report.exit_status import INCOMPLETE
    from pytest_libero_max.report.writers.files import write_reports
    from pytest_libero_max.report.writers.summary import summary_lines
    from pytest_libero_max.runs.merge import finished, merge_folders

    folders, left_out = finished(options.folders) if options.finished else (options.folders, [])
    merge_folders(folders, options.output)
    report, paths = write_reports(options.output)
    print("\n".join([*left_out, *summary_lines(report, [str(path) for path in paths])]))
    return 0 if report["pairs"]["complete"] else INCOMPLETE


def _gate(options: argparse.Namespace) -> int:
    from pytest_libero_max.cli.ini_file import ini_lines
    from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE
    from pytest_libero_max.report.gate_results import decide, gate_lines, require_usable
    from pytest_libero_max.report.gates import parse_gates
    from pytest_libero_max.report.writers.files import report_of
    from pytest_libero_max.report.writers.summary import incomplete_text
    from pytest_libero_max.runs.store import read_pairs

    here = Path.cwd()
    gates = parse_gates(options.gate or ini_lines("libero_max_gate", here))
    if not gates:
        raise OptionError(
            "There is no gate to decide. Give --gate=CONDITION, or libero_max_gate in pytest's ini file."
        )
    stored = read_pairs(options.folder)
    require_usable(gates, stored.run.planned, options.folder, here)
    verdicts = decide(gates, options.folder, here)
    print("\n".join(gate_lines(verdicts)))
    failed = [verdict for verdict in verdicts if not verdict.passed]
    counts = report_of(stored)["pairs"]
    if not counts["complete"]:
        print(f"{incomplete_text(counts)} Exit status {INCOMPLETE}.")
        return INCOMPLETE
    if failed:
        print(f"Exit status {GATE_FAILED}: {len(failed)} of {len(gates)} gates do not hold.")
        return GATE_FAILED
    return 0


def _power(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.writers.files import read_report
    from pytest_libero_max.report.writers.power_text import Expectation, expectations_of, power_lines

    if options.folder:
        expected = expectations_of(read_report(options.folder))
    else:
        expected = (
            Expectation("overall", options.base, options.gain),
            Expectation("one event", options.base, options.gain),
        )
    print("\n".join(power_lines(expected, options.change)))
