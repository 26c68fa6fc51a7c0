"""The ``libero-max`` command: what is done around runs, not in them. Thin."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pytest_libero_max.errors import LiberoMaxError, SubstrateError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: Words after ``libero-max``; those of the process by default.

    Returns:
        The exit status: 0, or 1 with a message on standard error.
    """
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except LiberoMaxError as error:
        print(f"libero-max: {error}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="libero-max", description="Around runs of pytest --libero-max-policy: measure, look, compare."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    bench = commands.add_parser(
        "bench", help="Measure stepping, rendering and pairs side by side with robosuite"
    )
    bench.add_argument(
        "--scene", default="libero_spatial/0", metavar="SUITE/TASK", help="Default: %(default)s"
    )
    bench.add_argument(
        "--steps", type=int, default=100, metavar="N", help="Control steps (default: %(default)s)"
    )
    bench.add_argument("--repeats", type=int, default=3, metavar="N", help="Pairs (default: %(default)s)")
    bench.set_defaults(run=_bench)

    genuine = commands.add_parser("bench-genuine", help="The same with an installed LIBERO's own environment")
    genuine.add_argument("--suite", default="libero_spatial", metavar="SUITE", help="Default: %(default)s")
    genuine.add_argument(
        "--steps", type=int, default=60, metavar="N", help="Control steps (default: %(default)s)"
    )
    genuine.add_argument("--repeats", type=int, default=1, metavar="N", help="Pairs (default: %(default)s)")
    _add_libero(genuine)
    genuine.set_defaults(run=_bench_genuine)

    doctor = commands.add_parser("doctor", help="Say what this machine lacks, and the commands that help")
    _add_libero(doctor)
    doctor.set_defaults(run=_doctor)

    report = commands.add_parser(
        "report", help="Compute the report of a run again from its pairs.jsonl alone"
    )
    report.add_argument("folder", type=Path, metavar="FOLDER")
    report.add_argument(
        "--figures",
        action="store_true",
        help="Also write the figures, as SVG and (with the extra figures) PNG",
    )
    report.add_argument("--tables", action="store_true", help="Also write the tables as CSV and LaTeX")
    report.set_defaults(run=_report)

    compare = commands.add_parser(
        "compare", help="Compare runs on the cases they share, and list what flipped"
    )
    compare.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    compare.add_argument(
        "--restrict", action="store_true", help="Compare on common cases where the runs have different ones"
    )
    compare.add_argument(
        "--flips", type=int, default=20, metavar="N", help="Listed at most (default: %(default)s)"
    )
    compare.add_argument("--json", type=Path, metavar="FILE", help="Also write the comparison here")
    compare.set_defaults(run=_compare)

    published = commands.add_parser("published", help="Print the results published in the paper")
    published.set_defaults(run=_published)

    merge = commands.add_parser("merge", help="Join the runs of shards into one")
    merge.add_argument("folders", type=Path, nargs="+", metavar="FOLDER")
    merge.add_argument("--output", type=Path, required=True, metavar="FOLDER")
    merge.set_defaults(run=_merge)

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
        help="Expected share of pairs that fail in Base and succeed in Dynamic (default: %(default)s)",
    )
    power.add_argument(
        "--change", type=float, metavar="CHANGE", help="A paired change to resolve, for example -0.05"
    )
    power.set_defaults(run=_power)

    catalogue = commands.add_parser("catalogue", help="Count the source variations of the embedded scenes")
    catalogue.set_defaults(run=_catalogue)

    gallery = commands.add_parser("gallery", help="Draw the embedded scenes, their variations and the events")
    gallery.add_argument("folder", type=Path, metavar="FOLDER")
    gallery.set_defaults(run=_gallery)

    smoke = commands.add_parser("freeze-smoke", help="Build the smoke track from nothing, with its preflight")
    smoke.add_argument("folder", type=Path, metavar="FOLDER")
    smoke.set_defaults(run=_freeze_smoke)
    return parser


def _add_libero(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--libero", type=Path, action="append", default=[], metavar="FOLDER", help="Checkout of a LIBERO"
    )
    command.add_argument(
        "--libero-assets",
        type=Path,
        metavar="FOLDER",
        help="Models and textures, if it has none of its own",
    )


def _bench_genuine(options: argparse.Namespace) -> None:
    from pytest_libero_max.bench.genuine import measure_genuine
    from pytest_libero_max.worlds.libero.installation import find_installation
    from pytest_libero_max.worlds.libero.substrate import LiberoSubstrate

    roots = options.libero or [None]
    substrate = LiberoSubstrate([find_installation(root, assets=options.libero_assets) for root in roots])
    times = measure_genuine(substrate, options.suite, steps=options.steps, repeats=options.repeats)
    substrate.close()
    print("\n".join(times.lines()))


def _doctor(options: argparse.Namespace) -> None:
    from pytest_libero_max.doctor import examine
    from pytest_libero_max.worlds.registry import SubstrateOptions

    findings = examine(SubstrateOptions(tuple(options.libero), options.libero_assets))
    print("\n".join(map(str, findings)))
    missing = [finding for finding in findings if finding.level == "missing"]
    if missing:
        raise SubstrateError(f"{len(missing)} of {len(findings)} findings are missing; see above.")


def _bench(options: argparse.Namespace) -> None:
    from pytest_libero_max.bench.pairs import measure_pairs
    from pytest_libero_max.bench.stepping import measure_stepping

    suite, _, index = options.scene.partition("/")
    print("\n".join(measure_stepping(suite, int(index or 0), steps=options.steps).lines()), flush=True)
    print("\n".join(measure_pairs(suite, repeats=options.repeats).lines()))


def _report(options: argparse.Namespace) -> None:
    from pytest_libero_max.report import raster
    from pytest_libero_max.report.output import write_figures, write_reports, write_text
    from pytest_libero_max.report.summary import summary_lines
    from pytest_libero_max.report.tables import csv_text, latex_text

    report, paths = write_reports(options.folder)
    if options.figures:
        paths += write_figures(report, options.folder)
    if options.tables:
        tables = {"report.csv": csv_text(report), "report.tex": latex_text(report)}
        for name, text in tables.items():
            write_text(options.folder / name, text)
        paths += [options.folder / name for name in tables]
    print("\n".join(summary_lines(report, [str(path) for path in paths])))
    if options.figures and not raster.available():
        print(f"Figures are SVG only; for PNG as well: {raster.INSTALL}")


def _compare(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.compare import compare_folders
    from pytest_libero_max.report.compare_text import comparison_lines
    from pytest_libero_max.report.output import report_json, write_text

    comparison = compare_folders(options.folders, options.restrict)
    if options.json:
        write_text(options.json, report_json(comparison))
    print("\n".join(comparison_lines(comparison, options.flips)))


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))


def _merge(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.merge import merge_folders
    from pytest_libero_max.report.output import write_reports
    from pytest_libero_max.report.summary import summary_lines

    merge_folders(options.folders, options.output)
    report, paths = write_reports(options.output)
    print("\n".join(summary_lines(report, [str(path) for path in paths])))


def _power(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.output import read_report
    from pytest_libero_max.report.planning import Expectation, expectations_of, power_lines

    if options.folder:
        expected = expectations_of(read_report(options.folder))
    else:
        expected = (
            Expectation("overall", options.base, options.gain),
            Expectation("one event", options.base, options.gain),
        )
    print("\n".join(power_lines(expected, options.change)))


def _catalogue(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.catalogue import count_lines

    print("\n".join(count_lines()))


def _gallery(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.catalogue import variant_of
    from pytest_libero_max.construction.catalogue.sheets import write_plus_sheet, write_pro_sheet
    from pytest_libero_max.construction.pictures import write_event_sheet
    from pytest_libero_max.worlds.embedded.gallery import write_contact_sheet
    from pytest_libero_max.worlds.embedded.substrate import EmbeddedSubstrate

    write_contact_sheet(options.folder / "scenes.png")
    substrate = EmbeddedSubstrate(variant_of)
    try:
        write_event_sheet(options.folder / "events.jpg", substrate)
        write_plus_sheet(options.folder / "plus.png", substrate)
        write_pro_sheet(options.folder / "pro.png", substrate)
    finally:
        substrate.close()


def _freeze_smoke(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.smoke import freeze_smoke
    from pytest_libero_max.worlds.registry import open_substrate

    substrate = open_substrate("embedded")
    try:
        manifest = freeze_smoke(options.folder, substrate)
    finally:
        substrate.close()
    print(f"{len(manifest)} cases, digest {manifest.digest}")
