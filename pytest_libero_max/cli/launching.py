"""The command that gives the shards of a run to a scheduler: launch."""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

_OURS = ("--libero-max-shard", "--libero-max-output", "--libero-max-resume")
"""What a job gives to pytest itself."""

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
cd {here} || exit
{before}# Shortly before its time limit the job is put into the queue again, and goes on where it was.
again() {{ [ "${{SLURM_RESTART_COUNT:-0}}" -ge {restarts} ] || scontrol requeue "$SLURM_JOB_ID"; }}
trap again USR1
{pytest} \\
    --libero-max-shard=env --libero-max-resume \\
    --libero-max-output={output}/shard-"$SLURM_ARRAY_TASK_ID" &
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
cd {here} || exit
{before}exec {merge} \\
    {output}/shard-{{1..{shards}}} --output {output}
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


def add_commands(commands: Commands) -> None:
    """Add ``launch`` to the parser."""
    launch = commands.add_parser(
        "launch",
        help="Print, or submit, the jobs of a scheduler that play the shards of a run and merge them",
        description="For example: libero-max launch slurm --shards 64 --workers 8 --sbatch=--time=04:00:00 "
        "-- --libero-max-policy=adapter.py --libero-max-track=max. Each shard writes into its own folder in "
        "the output folder, from which libero-max watch follows it; the merged run is written into the "
        "output folder itself, and names the shards that are missing. A job that is preempted, or reaches "
        "its time limit, goes on where it was.",
    )
    launch.add_argument("scheduler", choices=["slurm"], help="What the jobs are given to")
    launch.add_argument("--shards", type=int, required=True, metavar="N", help="Jobs of the array")
    launch.add_argument(
        "--at-once", type=int, metavar="N", help="Jobs that run at the same time (default: as many as can)"
    )
    launch.add_argument(
        "--workers", type=int, default=1, metavar="N", help="Workers of each job (default: %(default)s)"
    )
    launch.add_argument(
        "--output",
        type=Path,
        default=Path("libero-max-results"),
        metavar="FOLDER",
        help="On a file system that all nodes share (default: %(default)s)",
    )
    launch.add_argument(
        "--sbatch",
        action="append",
        default=[],
        metavar="OPTION",
        help="Of sbatch, for the shards, for example --sbatch=--time=04:00:00; may be repeated",
    )
    launch.add_argument(
        "--before",
        action="append",
        default=[],
        metavar="COMMAND",
        help="A line of shell that each job begins with, for example 'module load cuda'; may be repeated",
    )
    launch.add_argument(
        "--submit", action="store_true", help="Submit the jobs instead of printing the script"
    )
    launch.add_argument(
        "arguments", nargs="+", metavar="ARGUMENT", help="Of pytest, after --; among them the policy"
    )
    launch.set_defaults(run=_launch)


def _launch(options: argparse.Namespace) -> int:
    script = slurm_script(
        options.arguments,
        shards=options.shards,
        at_once=options.at_once,
        workers=options.workers,
        output=options.output.absolute(),
        sbatch=options.sbatch,
        before=options.before,
    )
    if not options.submit:
        print(script, end="")
        return 0
    try:
        return subprocess.run(["bash"], input=script, text=True, check=False).returncode
    except OSError as error:
        raise OptionError(f"Cannot run bash: {error}. Print the script, and run it yourself.") from error


def slurm_script(
    arguments: Sequence[str],
    *,
    shards: int,
    output: Path,
    at_once: int | None = None,
    workers: int = 1,
    sbatch: Sequence[str] = (),
    before: Sequence[str] = (),
) -> str:
    """A script for bash that submits an array of shards, and the job that merges them.

    Args:
        arguments: Of pytest.
        shards: How many.
        output: Where the runs go; absolute.
        at_once: Shards that are played at the same time; None for no limit.
        workers: Workers of each shard.
        sbatch: More options of sbatch for the shards.
        before: Lines of shell that each job begins with.

    Raises:
        OptionError: A number or an argument of pytest cannot be used.
    """
    for name, value, least in (("shards", shards, 2), ("at-once", at_once, 1), ("workers", workers, 1)):
        if value is not None and value < least:
            raise OptionError(f"--{name}={value}, but must be at least {least}.")
    for argument in arguments:
        if argument.split("=")[0] in _OURS:
            raise OptionError(
                f"{argument}: each job gives that to pytest itself. Take it away; --output is ours."
            )
    for line in (*arguments, *sbatch, *before, str(output)):
        if "\n" in line:
            raise OptionError(f"{line!r} has several lines, which a script of jobs cannot hold. Write one.")
    logs = str(output / "logs").replace("%", "%%")
    # Options of sbatch that come later win.
    options = [
        *("--requeue", "--open-mode=append", f"--cpus-per-task={workers}", "--signal=B:USR1@120"),
        *(f"--output={logs}/%A_%a.log", *sbatch),
    ]
    return _SCRIPT.format(
        shards=shards,
        array=f"1-{shards}" + ("" if at_once is None else f"%{at_once}"),
        output=shlex.quote(str(output)),
        options=shlex.join(options),
        merge_options=shlex.join([f"--output={logs}/merge-%j.log"]),
        here=shlex.quote(str(Path.cwd())),
        before="".join(f"{line}\n" for line in before),
        restarts=_RESTARTS,
        pytest=shlex.join([sys.executable, "-m", "pytest", "-n", str(workers), *arguments]),
        merge=shlex.join([sys.executable, "-m", "pytest_libero_max.cli", "merge", "--finished"]),
    )
