"""``libero-max power``: differences that a number of pairs can show."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``power`` to the parser."""
    power = commands.add_parser(
        "power", help="Changes that each track can resolve, and number of pairs that a change needs"
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


def _power(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.writers.power_text import Expectation, expectations_of, power_lines
    from pytest_libero_max.report.writers.report_files import read_report

    if options.folder:
        expected = expectations_of(read_report(options.folder))
    else:
        expected = (
            Expectation("overall", options.base, options.gain),
            Expectation("one event", options.base, options.gain),
        )
    print("\n".join(power_lines(expected, options.change)))
