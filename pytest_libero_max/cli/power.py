"""``libero-max plan pairs`` and ``gates``: differences that a number of pairs can show."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, option, whole_number
from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    from pytest_libero_max.report.writers.power_text import Expectation


def add_command(commands: Commands) -> None:
    """Add ``pairs`` and ``gates`` to the parser."""
    pairs = commands.add_parser(
        "pairs", help="Changes that each track resolves, and the pairs that a change needs"
    )
    _add_expectation(pairs)
    option(
        pairs,
        "--change CHANGE",
        "A paired change to resolve, for example -0.05, or 0.05 for a gain; for a loss it also advises "
        "gates, numbers of pairs and tracks that find it",
        type=float,
    )
    pairs.set_defaults(run=_pairs)

    gates = commands.add_parser("gates", help="Probability that gates pass, by the true loss")
    option(
        gates,
        "--gate CONDITION",
        "The gate; for one against another run, --base is the Dynamic success of that run, which need not "
        "exist; may be repeated",
        many=True,
        required=True,
    )
    _add_expectation(gates)
    size = gates.add_mutually_exclusive_group()
    option(size, "--track NAME", "Track that the gate is decided on (default: smoke)")
    option(size, "--pairs N", "Number of pairs that it is decided on", type=whole_number(1))
    option(
        gates,
        "--loss RATE",
        "Share of pairs that the effect to be found loses, with those lost by chance (default: several)",
        type=float,
    )
    gates.set_defaults(run=_gates)


def _add_expectation(command: argparse.ArgumentParser) -> None:
    """Add the options that say what is expected of a run."""
    known = command.add_mutually_exclusive_group(required=True)
    option(known, "--run FOLDER", "Expect what this run measured", type=Path, dest="folder")
    option(known, "--base RATE", "Expected Base success, 0 to 1", type=float)
    option(
        command,
        "--gain RATE",
        "Expected share of pairs that are gained by chance, and lost by chance",
        type=float,
        default=0.01,
    )


def _expected(options: argparse.Namespace) -> tuple[Expectation, ...]:
    from pytest_libero_max.report.writers.power_text import Expectation, chance_of, expectations_of
    from pytest_libero_max.report.writers.report_files import read_report

    if options.folder:
        report = read_report(options.folder)
        say([chance_of(report)[1], ""])
        return expectations_of(report)
    return (
        Expectation("overall", options.base, options.gain),
        Expectation("one event", options.base, options.gain),
    )


def _pairs(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.gate_plan import advice_lines
    from pytest_libero_max.report.writers.power_text import power_lines

    expected = _expected(options)
    say(power_lines(expected, options.change))
    base, chance = expected[0].base, expected[0].loss
    if options.change is not None and 0 < -options.change <= base - chance:
        say(["", *advice_lines(base, chance, -options.change)])


def _gates(options: argparse.Namespace) -> None:
    expected = _expected(options)
    say(line for plan in _gate_plans(options, expected[0]) for line in plan)


def _gate_plans(options: argparse.Namespace, expected: Expectation) -> Iterator[list[str]]:
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.report.gate_plan import gate_plan_lines
    from pytest_libero_max.report.gates import parse_gates
    from pytest_libero_max.runs.plan import PlannedPair

    planned = options.pairs or tuple(map(PlannedPair.of, load_track(options.track or "smoke")))
    for number, gate in enumerate(parse_gates(options.gate)):
        lines = gate_plan_lines(gate, planned, expected.base, expected.gain, options.loss)
        yield ["", *lines] if number else lines
