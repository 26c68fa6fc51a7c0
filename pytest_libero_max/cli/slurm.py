"""``libero-max shards slurm``: the shards of a run as jobs of a scheduler."""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, option, switch, whole_number
from pytest_libero_max.errors import OptionError

_RESTARTS = 100
"""Number of times that a job is put into the queue again after it has reached its time limit."""

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
{beginning}exec {merge} \\
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


def add_command(commands: Commands) -> None:
    """Add ``slurm`` to the parser."""
    slurm = commands.add_parser(
        "slurm",
        help="Print, or submit, an array of jobs of Slurm that play shards, and a job that merges them",
        description="For example: libero-max shards slurm --shards 64 --workers 8 --sbatch=--time=04:00:00 "
        "-- --libero-max-policy=adapter.py --libero-max-track=max. Prints a script for bash. A job that is "
        "preempted, or reaches its time limit, goes on where it was. Submit the jobs again to play what is "
        "missing. Each shard writes into its own folder in the output folder, from which libero-max runs "
        "--follow follows it; the merged run is written into the output folder itself, and names the shards "
        "that are missing.",
    )
    option(slurm, "--shards N", "Number of shards", type=whole_number(2), required=True)
    option(
        slurm, "--at-once N", "Shards that are played at the same time (default: all)", type=whole_number(1)
    )
    option(slurm, "--workers N", "Workers of each shard", type=whole_number(1), default=1)
    option(slurm, "--output FOLDER", "On a file system that all nodes share", default="libero-max-results")
    option(
        slurm,
        "--before COMMAND",
        "A line of shell that each job begins with, for example 'module load cuda'; may be repeated",
        many=True,
    )
    switch(slurm, "--submit", "Submit the jobs instead of printing them")
    slurm.add_argument(
        "arguments", nargs="+", metavar="ARGUMENT", help="Of pytest, after --; among them the policy"
    )
    option(
        slurm,
        "--sbatch OPTION",
        "Of sbatch, for the shards, for example --sbatch=--time=04:00:00; may be repeated",
        many=True,
    )
    slurm.set_defaults(run=_launch)


def _launch(options: argparse.Namespace) -> int:
    script = slurm_script(
        options.arguments,
        options.shards,
        Path(options.output).absolute(),
        at_once=options.at_once,
        workers=options.workers,
        before=options.before,
        sbatch=options.sbatch,
    )
    if not options.submit:
        print(script, end="")
        return 0
    try:
        return subprocess.run(["bash"], input=script, text=True, check=False).returncode
    except OSError as error:
        raise OptionError(
            f"Cannot run bash: {error}. Without --submit the jobs are printed: submit them where bash is."
        ) from error


_OURS = ("--libero-max-shard", "--libero-max-output", "--libero-max-resume")
"""Options that a job gives to pytest itself."""


def slurm_script(
    arguments: Sequence[str],
    shards: int,
    output: Path,
    *,
    at_once: int | None = None,
    workers: int = 1,
    before: Sequence[str] = (),
    sbatch: Sequence[str] = (),
) -> str:
    """Return a script for bash that submits an array of shards, and the job that merges them.

    Raises:
        OptionError: A word has several lines, or an argument of pytest cannot be used.
    """
    for argument in arguments:
        if argument.split("=")[0] in _OURS:
            raise OptionError(
                f"{argument}: each job gives that to pytest itself. Take it away; --output is ours."
            )
    for word in (*arguments, *before, *sbatch, str(output)):
        if "\n" in word:
            raise OptionError(f"{word!r} has several lines, which a script of jobs cannot hold. Write one.")
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
        beginning="".join(f"{line}\n" for line in (f"cd {shlex.quote(str(Path.cwd()))} || exit", *before)),
        restarts=_RESTARTS,
        pytest=shlex.join([sys.executable, "-m", "pytest", "-n", str(workers), *arguments]),
        merge=shlex.join([sys.executable, "-m", "pytest_libero_max.cli", "shards", "merge", "--finished"]),
    )
