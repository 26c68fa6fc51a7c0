"""The command that gives the shards of a run to a scheduler: launch. One module a scheduler."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pytest_libero_max.cli.launching import kubernetes, slurm

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add ``launch`` to the parser."""
    launch = commands.add_parser(
        "launch",
        help="Print, or submit, the jobs of a scheduler that play the shards of a run and merge them",
        description="Each shard writes into its own folder in the output folder, from which libero-max watch "
        "follows it; the merged run is written into the output folder itself, and names the shards that are "
        "missing.",
    )
    schedulers = launch.add_subparsers(required=True, metavar="SCHEDULER")
    for scheduler in (slurm, kubernetes):
        scheduler.add_command(schedulers)
