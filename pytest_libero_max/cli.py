"""The ``libero-max`` command: what is done around runs, not in them. Thin."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pytest_libero_max.errors import LiberoMaxError


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

    bench = commands.add_parser("bench", help="Measure stepping, rendering and pairs side by side with robosuite")
    bench.add_argument("--scene", default="libero_spatial/0", metavar="SUITE/TASK", help="Default: %(default)s")
    bench.add_argument("--steps", type=int, default=100, metavar="N", help="Control steps (default: %(default)s)")
    bench.add_argument("--repeats", type=int, default=3, metavar="N", help="Pairs (default: %(default)s)")
    bench.set_defaults(run=_bench)

    report = commands.add_parser("report", help="Compute the report of a run again from its pairs.jsonl alone")
    report.add_argument("folder", type=Path, metavar="FOLDER")
    report.set_defaults(run=_report)

    gallery = commands.add_parser("gallery", help="Draw the embedded scenes and what each event does to one")
    gallery.add_argument("folder", type=Path, metavar="FOLDER")
    gallery.set_defaults(run=_gallery)

    smoke = commands.add_parser("freeze-smoke", help="Build the smoke track from nothing, with its preflight")
    smoke.add_argument("folder", type=Path, metavar="FOLDER")
    smoke.set_defaults(run=_freeze_smoke)
    return parser


def _bench(options: argparse.Namespace) -> None:
    from pytest_libero_max.bench.pairs import measure_pairs
    from pytest_libero_max.bench.stepping import measure_stepping

    suite, _, index = options.scene.partition("/")
    print("\n".join(measure_stepping(suite, int(index or 0), steps=options.steps).lines()), flush=True)
    print("\n".join(measure_pairs(suite, repeats=options.repeats).lines()))


def _report(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.output import write_reports
    from pytest_libero_max.report.summary import summary_lines

    report, paths = write_reports(options.folder)
    print("\n".join(summary_lines(report, [str(path) for path in paths])))


def _gallery(options: argparse.Namespace) -> None:
    from pytest_libero_max.construction.pictures import write_event_sheet
    from pytest_libero_max.worlds.embedded.gallery import write_contact_sheet
    from pytest_libero_max.worlds.registry import open_substrate

    write_contact_sheet(options.folder / "scenes.png")
    substrate = open_substrate("embedded")
    try:
        write_event_sheet(options.folder / "events.jpg", substrate)
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
