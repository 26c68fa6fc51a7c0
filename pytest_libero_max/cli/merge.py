"""``libero-max shards merge``: the runs of shards joined into one."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.cli.arguments import Commands, option, switch
from pytest_libero_max.cli.terminal import say_coloured
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from pytest_libero_max.report.gates import Gate


def add_command(commands: Commands) -> None:
    """Add ``merge`` to the parser."""
    merge = commands.add_parser(
        "merge",
        help="Join the runs of shards into one, and decide their gates; exit status 10 where one does not "
        "hold, 11 where pairs are missing",
    )
    merge.add_argument(
        "folders", type=Path, nargs="+", metavar="FOLDER", help="The output folders of the shards"
    )
    option(merge, "--output FOLDER", "Folder for the joined run", type=Path, required=True)
    switch(
        merge,
        "--finished",
        "Leave out the folders whose run has not ended or not begun, and say which; may be done again "
        "when more have ended",
    )
    option(
        merge,
        "--gate CONDITION",
        "As well as the gates that the shards were given; may be repeated",
        many=True,
    )
    merge.set_defaults(run=_merge)


def _declared(provenance: Json, asked: Sequence[Gate]) -> tuple[Gate, ...]:
    """Return the gates that the shards were given."""
    from pytest_libero_max.report.gates import parse_gates

    given = {gate.text for gate in asked}
    declared = tuple(gate for gate in parse_gates(provenance.get("gates") or ()) if gate.text not in given)
    for gate in declared:
        if gate.run is not None:
            raise OptionError.seen(
                "gate",
                gate.text,
                f" of the shards names the run {gate.run!r}. Nothing that a folder names is opened: give it "
                f"again with --gate={shlex.quote(gate.text)}.",
            )
    return declared


def _merge(options: argparse.Namespace) -> int:
    from pytest_libero_max.cli.report import run_summary
    from pytest_libero_max.report.exit_status import GATE_FAILED, INCOMPLETE
    from pytest_libero_max.report.gate_results import decide, require_usable
    from pytest_libero_max.report.gate_text import gate_lines, not_passed_text
    from pytest_libero_max.report.gates import parse_gates
    from pytest_libero_max.report.writers.report_files import write_reports
    from pytest_libero_max.runs.merge import finished, merge_folders

    folders, left_out = finished(options.folders) if options.finished else (options.folders, [])
    asked = parse_gates(options.gate)
    run, here = merge_folders(folders, options.output).run, Path.cwd()
    gates = (*_declared(run.provenance, asked), *asked)
    verdicts = decide(gates, options.output, here)
    report, paths = write_reports(options.output, gates=verdicts)
    say_coloured([*left_out, *run_summary(options.output, report, paths)])
    if report.pairs.complete:
        require_usable(gates, run.planned, run.planned, options.output, here)
    failed = not_passed_text(verdicts)
    if verdicts:
        say_coloured(gate_lines(verdicts))
    if not report.pairs.complete:
        return INCOMPLETE
    if failed:
        print(f"Exit status {GATE_FAILED}: {failed}")
    return GATE_FAILED if failed else 0
