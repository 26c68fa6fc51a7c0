"""``libero-max launch``: the shards of a run as jobs of a scheduler."""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
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


def add_command(commands: Commands) -> None:
    """Add ``launch`` to the parser, with a command for each scheduler."""
    launch = commands.add_parser(
        "launch",
        help="Print, or submit, the jobs of a scheduler that play the shards of a run and merge them",
        description="Each shard writes into its own folder in the output folder, from which libero-max watch "
        "follows it; the merged run is written into the output folder itself, and names the shards that are "
        "missing.",
    )
    schedulers = launch.add_subparsers(required=True, metavar="SCHEDULER")
    slurm = schedulers.add_parser(
        "slurm",
        help="Shards as an array of jobs of Slurm, and a job that merges them when all have ended",
        description="For example: libero-max launch slurm --shards 64 --workers 8 --sbatch=--time=04:00:00 "
        "-- --libero-max-policy=adapter.py --libero-max-track=max. Prints a script for bash. A job that is "
        "preempted, or reaches its time limit, goes on where it was. Submit the jobs again to play what is "
        "missing.",
    )
    _add_shards(slurm)
    option(
        slurm,
        "--sbatch OPTION",
        "Of sbatch, for the shards, for example --sbatch=--time=04:00:00; may be repeated",
        many=True,
    )
    slurm.set_defaults(run=_launch)


def _launch(options: argparse.Namespace) -> int:
    script = slurm_script(Shards.of(options), Path(options.output).absolute(), options.sbatch)
    if options.submit:
        return _hand_over(script, ["bash"])
    print(script, end="")
    return 0


def slurm_script(shards: Shards, output: Path, sbatch: Sequence[str] = ()) -> str:
    """Return a script for bash that submits an array of shards, and the job that merges them.

    Args:
        shards: The shards to play.
        output: Folder of the runs; absolute.
        sbatch: More options of sbatch for the shards.

    Raises:
        OptionError: A word has several lines.
    """
    _require_lines(*sbatch, str(output))
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


_OURS = ("--libero-max-shard", "--libero-max-output", "--libero-max-resume")
"""Options that a job gives to pytest itself."""


@dataclass(frozen=True)
class Shards:
    """The shards of a run, as they are to be played.

    Attributes:
        arguments: Of pytest.
        count: Number of shards.
        at_once: Shards that are played at the same time; None for no limit.
        workers: Workers of each shard.
        before: Lines of shell that each job begins with.

    Raises:
        OptionError: An argument of pytest cannot be used.
    """

    arguments: Sequence[str]
    count: int
    at_once: int | None = None
    workers: int = 1
    before: Sequence[str] = ()

    def __post_init__(self) -> None:
        for argument in self.arguments:
            if argument.split("=")[0] in _OURS:
                raise OptionError(
                    f"{argument}: each job gives that to pytest itself. Take it away; --output is ours."
                )
        _require_lines(*self.arguments, *self.before)

    @classmethod
    def of(cls, options: argparse.Namespace) -> Shards:
        """Return the shards that are asked for."""
        return cls(options.arguments, options.shards, options.at_once, options.workers, options.before)

    def beginning(self, folder: str) -> str:
        """Return the first lines of a job's script: it goes to its folder, and gets ready."""
        return "".join(f"{line}\n" for line in (f"cd {shlex.quote(folder)} || exit", *self.before))

    def pytest(self, python: str, output: str, number: str) -> str:
        """Return the command that plays a shard.

        Args:
            python: The interpreter.
            output: Folder of the runs.
            number: The number of the shard, from 1, as the shell finds it.
        """
        words = shlex.join([python, "-m", "pytest", "-n", str(self.workers), *self.arguments])
        folder = f'{shlex.quote(output)}/shard-"{number}"'
        return (
            f"{words} \\\n    --libero-max-shard=env --libero-max-resume \\\n    --libero-max-output={folder}"
        )

    def merge(self, python: str, output: str, *flags: str) -> str:
        """Return the command that merges the shards, for bash."""
        words = shlex.join([python, "-m", "pytest_libero_max.cli", "merge", *flags])
        output = shlex.quote(output)
        return f"{words} \\\n    {output}/shard-{{1..{self.count}}} --output {output}"


def _add_shards(parser: argparse.ArgumentParser) -> None:
    option(parser, "--shards N", "Number of shards", type=whole_number(2), required=True)
    option(
        parser, "--at-once N", "Shards that are played at the same time (default: all)", type=whole_number(1)
    )
    option(parser, "--workers N", "Workers of each shard", type=whole_number(1), default=1)
    option(parser, "--output FOLDER", "On a file system that all nodes share", default="libero-max-results")
    option(
        parser,
        "--before COMMAND",
        "A line of shell that each job begins with, for example 'module load cuda'; may be repeated",
        many=True,
    )
    switch(parser, "--submit", "Submit the jobs instead of printing them")
    parser.add_argument(
        "arguments", nargs="+", metavar="ARGUMENT", help="Of pytest, after --; among them the policy"
    )


def _require_lines(*words: str) -> None:
    """Check that each of some words has one line.

    Raises:
        OptionError: One has several.
    """
    for word in words:
        if "\n" in word:
            raise OptionError(f"{word!r} has several lines, which a script of jobs cannot hold. Write one.")


def _hand_over(jobs: str, command: Sequence[str]) -> int:
    """Give jobs to the standard input of a command; return its exit status.

    Raises:
        OptionError: It cannot be run.
    """
    try:
        return subprocess.run(command, input=jobs, text=True, check=False).returncode
    except OSError as error:
        raise OptionError(
            f"Cannot run {command[0]}: {error}. Without --submit the jobs are printed: submit them where "
            f"{command[0]} is."
        ) from error
