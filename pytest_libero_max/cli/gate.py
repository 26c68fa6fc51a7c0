"""``libero-max gate``: gates decided on a stored run."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option
from pytest_libero_max.cli.terminal import say, say_coloured
from pytest_libero_max.errors import OptionError


def add_command(commands: Commands) -> None:
    """Add ``gate`` to the parser."""
    gate = commands.add_parser(
        "gate", help="Decide gates on a stored run; exit status 10 where one does not hold, 11 if incomplete"
    )
    gate.add_argument("folder", type=Path, metavar="FOLDER", help="The output folder of the run")
    option(
        gate,
        "--gate CONDITION",
        "For example 'dynamic_sr >= 0.6'; may be repeated (default: libero_max_gate of the ini file)",
        many=True,
    )
    gate.set_defaults(run=_gate)


def _gate(options: argparse.Namespace) -> int:
    from pytest_libero_max.cli.ini_file import gates_of
    from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE, ended_as_declared
    from pytest_libero_max.report.gate_results import decide_on, require_usable, shards_of
    from pytest_libero_max.report.gate_text import gate_lines, not_passed_text
    from pytest_libero_max.report.run_texts import incomplete_text
    from pytest_libero_max.report.writers.report_files import report_of
    from pytest_libero_max.runs.media import show_command
    from pytest_libero_max.runs.outside import outside_text
    from pytest_libero_max.runs.replay_command import replay_command
    from pytest_libero_max.runs.store import read_pairs

    gates, start = gates_of(options.gate, Path.cwd())
    if not gates:
        raise OptionError(
            "There is no gate to decide. Give --gate=CONDITION, or libero_max_gate in pytest's ini file."
        )
    stored = read_pairs(options.folder)
    if not shards_of(stored):
        require_usable(gates, stored.run.planned, stored.run.planned, options.folder, start)
    report = report_of(stored)
    verdicts = decide_on(gates, stored, report, start)
    lost = [name for verdict in verdicts for name in verdict.lost]
    show = show_command(options.folder, str(options.folder), lost[:1], stored.run.provenance)
    say_coloured(gate_lines(verdicts, replay_command(stored), show))
    if (outside := outside_text(stored.run.provenance)) is not None and lost and show is None:
        say([f"The command is as the folder names it: read it before you give it. {outside}"])
    failed = not_passed_text(verdicts)
    counts = report.pairs
    if not ended_as_declared(counts):
        say([f"{incomplete_text(counts)} Exit status {INCOMPLETE}."])
        return INCOMPLETE
    if failed:
        print(f"Exit status {GATE_FAILED}: {failed}")
        return GATE_FAILED
    return 0
