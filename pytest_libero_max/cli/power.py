"""``libero-max power``: differences that a number of pairs can show."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.report.writers.power_text import Expectation

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``power`` to the parser."""
    power = commands.add_parser(
        "power", help="Changes that each track resolves, pairs that a change needs, how often a gate passes"
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
        help="A paired change to resolve, for example -0.05, or 0.05 for a gain; for a loss it also advises "
        "gates, numbers of pairs and tracks that find it",
    )
    power.add_argument(
        "--gate",
        action="append",
        default=[],
        metavar="CONDITION",
        help="Probability that this gate passes, by the true loss; for one against another run, --base is "
        "the Dynamic success of that run, which need not exist; may be repeated",
    )
    size = power.add_mutually_exclusive_group()
    size.add_argument("--track", metavar="NAME", help="Track that the gate is decided on (default: smoke)")
    size.add_argument("--pairs", type=int, metavar="N", help="Number of pairs that it is decided on")
    power.add_argument(
        "--loss",
        type=float,
        metavar="RATE",
        help="Share of pairs that the effect to be found loses, with those lost by chance (default: several)",
    )
    power.set_defaults(run=_power)


def _power(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.writers.gate_plan_text import advice_lines
    from pytest_libero_max.report.writers.power_text import (
        Expectation,
        chance_of,
        expectations_of,
        power_lines,
    )
    from pytest_libero_max.report.writers.report_files import read_report

    if options.folder:
        report = read_report(options.folder)
        expected = expectations_of(report)
        say([chance_of(report)[1], ""])
    else:
        expected = (
            Expectation("overall", options.base, options.gain),
            Expectation("one event", options.base, options.gain),
        )
    if options.gate:
        say(line for plan in _gate_plans(options, expected[0]) for line in plan)
        return
    _refuse_without_gate(options)
    say(power_lines(expected, options.change))
    base, chance = expected[0].base, expected[0].loss
    if options.change is not None and 0 < -options.change <= base - chance:
        say(["", *advice_lines(base, chance, -options.change)])


def _gate_plans(options: argparse.Namespace, expected: Expectation) -> Iterator[list[str]]:
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.report.gates import parse_gates
    from pytest_libero_max.report.writers.gate_plan_text import gate_plan_lines
    from pytest_libero_max.runs.plan import PlannedPair

    pairs = options.pairs
    if pairs is not None and pairs < 1:
        raise OptionError.seen("pairs", pairs, ", but a gate needs at least one pair.")
    planned = pairs or tuple(map(PlannedPair.of, load_track(options.track or "smoke")))
    for number, gate in enumerate(parse_gates(options.gate)):
        lines = gate_plan_lines(gate, planned, expected.base, expected.gain, options.loss)
        yield ["", *lines] if number else lines


def _refuse_without_gate(options: argparse.Namespace) -> None:
    for name in ("track", "pairs", "loss"):
        if getattr(options, name) is not None:
            raise OptionError(f"--{name} plans a gate, but there is no --gate. Add one, or leave it out.")
