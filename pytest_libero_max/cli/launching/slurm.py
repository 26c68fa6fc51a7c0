"""Shards as an array of jobs of Slurm."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.launching.shards import Shards, add_arguments, hand_over, require_lines

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

_RESTARTS = 100
"""So often a job that has reached its time limit is put into the queue again."""

_SCRIPT = """\
#!/bin/bash
# Submits {shards} shards as an array of jobs, and a job that merges them when all have ended.
# Submit it again to go on: what is measured is kept and not played again.
set -euo pipefail

play_shard() {{
    cat <<'END_OF_JOB'
#!/bin/bash
export LIBERO_MAX_SHARDS={shards}
{beginning}# Shortly before its time limit the job is put into the queue again, and goes on where it was.
again() {{ [ "${{SLURM_RESTART_COUNT:-0}}" -ge {restarts} ] || scontrol requeue "$SLURM_JOB_ID"; }}
trap again USR1
{pytest} &
pytest=$!
while true; do
    wait "$pytest"
    status=$?
    # A signal ends the waiting as well.
    [ "$status" -gt 128 ] && kill -0 "$pytest" 2> /dev/null || exit "$status"
done
END_OF_JOB
}}

merge_shards() {{
    cat <<'END_OF_JOB'
#!/bin/bash
{beginning}exec {merge}
END_OF_JOB
}}

mkdir -p {output}/logs
array=$(play_shard | sbatch --parsable --job-name=libero-max --array={array} \\
    {options})
array=${{array%%;*}}
merge=$(merge_shards | sbatch --parsable --job-name=libero-max-merge --dependency=afterany:"$array" \\
    {merge_options})
echo "Submitted $array, an array of {shards} shards, and ${{merge%%;*}}, which merges them into "{output}.
"""


def add_command(schedulers: Commands) -> None:
    """Add ``launch slurm`` to the parser."""
    slurm = schedulers.add_parser(
        "slurm",
        help="Shards as an array of jobs of Slurm, and a job that merges them when all have ended",
        description="For example: libero-max launch slurm --shards 64 --workers 8 --sbatch=--time=04:00:00 "
        "-- --libero-max-policy=adapter.py --libero-max-track=max. Prints a script for bash. A job that is "
        "preempted, or reaches its time limit, goes on where it was. Submit the jobs again to play what is "
        "missing.",
    )
    add_arguments(slurm, "On a file system that all nodes share")
    slurm.add_argument(
        "--sbatch",
        action="append",
        default=[],
        metavar="OPTION",
        help="Of sbatch, for the shards, for example --sbatch=--time=04:00:00; may be repeated",
    )
    slurm.set_defaults(run=_launch)


def _launch(options: argparse.Namespace) -> int:
    script = slurm_script(Shards.of(options), Path(options.output).absolute(), options.sbatch)
    if options.submit:
        return hand_over(script, ["bash"])
    print(script, end="")
    return 0


def slurm_script(shards: Shards, output: Path, sbatch: Sequence[str] = ()) -> str:
    """A script for bash that submits an array of shards, and the job that merges them.

    Args:
        shards: What is to be played.
        output: Where the runs go; absolute.
        sbatch: More options of sbatch for the shards.

    Raises:
        OptionError: A word has several lines.
    """
    require_lines(*sbatch, str(output))
    logs = str(output / "logs").replace("%", "%%")
    # Options of sbatch that come later win.
    options = [
        *("--requeue", "--open-mode=append", f"--cpus-per-task={shards.workers}", "--signal=B:USR1@120"),
        *(f"--output={logs}/%A_%a.log", *sbatch),
    ]
    return _SCRIPT.format(
        shards=shards.count,
        array=f"1-{shards.count}" + ("" if shards.at_once is None else f"%{shards.at_once}"),
        output=shlex.quote(str(output)),
        options=shlex.join(options),
        merge_options=shlex.join([f"--output={logs}/merge-%j.log"]),
        beginning=shards.beginning(str(Path.cwd())),
        restarts=_RESTARTS,
        pytest=shards.pytest(sys.executable, str(output), "$SLURM_ARRAY_TASK_ID"),
        merge=shards.merge(sys.executable, str(output), "--finished"),
    )
