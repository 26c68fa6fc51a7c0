"""``libero-max lab fingerprint``: a short hash of what this installation computes and draws."""

from __future__ import annotations

import argparse
import json
from contextlib import closing
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, add_substrate, option, substrate_options
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``fingerprint`` to the parser."""
    fingerprint = commands.add_parser(
        "fingerprint",
        help="Print a short hash of what this installation computes and draws, or compare two installations",
        description="Eight cases of the track original, one for each event: compiled scenes and textures, "
        "bare physics, the first control, a replay of fixed actions, images of both cameras, events and the "
        "images after them; beside these, the inputs that each profile makes of a made-up observation, and "
        "when a policy is asked. Each layer has a digest and numbers; all together have the hash to quote. "
        "Equal hashes mean equal bits; --compare says which layers differ and by how much, and ends with "
        "exit status 1 then. Layers come from the first cause to the last effect: other textures are other "
        "images too.",
    )
    option(fingerprint, "--output FILE", "Also write the fingerprint here, as JSON", type=Path)
    option(fingerprint, "--compare FILE", "Compare two files of --output instead", type=Path, nargs=2)
    add_substrate(fingerprint)
    fingerprint.set_defaults(run=_fingerprint)


def _fingerprint(options: argparse.Namespace) -> int:
    from pytest_libero_max.lab.fingerprint import comparison_lines, fingerprint_lines, read_fingerprint, take
    from pytest_libero_max.report.writers.report_files import write_text
    from pytest_libero_max.substrates.registry import open_substrate
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    if options.compare:
        first, second = map(read_fingerprint, options.compare)
        say(comparison_lines(first, second))
        return int(first["hash"] != second["hash"])
    use_one_blas_thread()  # as in runs
    told = substrate_options(options)
    with closing(open_substrate(options.substrate.name, told)) as substrate:
        found = take(substrate)
    if options.output:
        write_text(options.output, json.dumps(found) + "\n")
    say(fingerprint_lines(found))
    return 0
