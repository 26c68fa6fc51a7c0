"""What the jobs of every scheduler have in common."""

from __future__ import annotations

import argparse
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from pytest_libero_max.errors import OptionError

_OURS = ("--libero-max-shard", "--libero-max-output", "--libero-max-resume")
"""What a job gives to pytest itself."""


@dataclass(frozen=True)
class Shards:
    """The shards of a run, as they are to be played.

    Attributes:
        arguments: Of pytest.
        count: How many shards there are.
        at_once: Shards that are played at the same time; None for no limit.
        workers: Workers of each shard.
        before: Lines of shell that each job begins with.

    Raises:
        OptionError: A number or an argument of pytest cannot be used.
    """

    arguments: Sequence[str]
    count: int
    at_once: int | None = None
    workers: int = 1
    before: Sequence[str] = ()

    def __post_init__(self) -> None:
        numbers = (("shards", self.count, 2), ("at-once", self.at_once, 1), ("workers", self.workers, 1))
        for name, value, least in numbers:
            if value is not None and value < least:
                raise OptionError(f"--{name}={value}, but must be at least {least}.")
        for argument in self.arguments:
            if argument.split("=")[0] in _OURS:
                raise OptionError(
                    f"{argument}: each job gives that to pytest itself. Take it away; --output is ours."
                )
        require_lines(*self.arguments, *self.before)

    @classmethod
    def of(cls, options: argparse.Namespace) -> Shards:
        """The shards that are asked for."""
        return cls(options.arguments, options.shards, options.at_once, options.workers, options.before)

    def beginning(self, folder: str) -> str:
        """The first lines of a job's script: it goes to its folder, and gets ready."""
        return "".join(f"{line}\n" for line in (f"cd {shlex.quote(folder)} || exit", *self.before))

    def pytest(self, python: str, output: str, number: str) -> str:
        """The command that plays a shard.

        Args:
            python: The interpreter.
            output: Where the runs go.
            number: The number of the shard, from 1, as the shell finds it.
        """
        words = shlex.join([python, "-m", "pytest", "-n", str(self.workers), *self.arguments])
        folder = f'{shlex.quote(output)}/shard-"{number}"'
        return (
            f"{words} \\\n    --libero-max-shard=env --libero-max-resume \\\n    --libero-max-output={folder}"
        )

    def merge(self, python: str, output: str, *flags: str) -> str:
        """The command that merges the shards, for bash."""
        words = shlex.join([python, "-m", "pytest_libero_max.cli", "merge", *flags])
        output = shlex.quote(output)
        return f"{words} \\\n    {output}/shard-{{1..{self.count}}} --output {output}"


def add_arguments(parser: argparse.ArgumentParser, output: str) -> None:
    """Add what every scheduler is told.

    Args:
        parser: Of one scheduler.
        output: Where the output folder has to be.
    """
    parser.add_argument("--shards", type=int, required=True, metavar="N", help="How many there are")
    parser.add_argument(
        "--at-once", type=int, metavar="N", help="Shards that are played at the same time (default: all)"
    )
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N", help="Workers of each shard (default: %(default)s)"
    )
    parser.add_argument(
        "--output",
        default="libero-max-results",
        metavar="FOLDER",
        help=f"{output} (default: %(default)s)",
    )
    parser.add_argument(
        "--before",
        action="append",
        default=[],
        metavar="COMMAND",
        help="A line of shell that each job begins with, for example 'module load cuda'; may be repeated",
    )
    parser.add_argument("--submit", action="store_true", help="Submit the jobs instead of printing them")
    parser.add_argument(
        "arguments", nargs="+", metavar="ARGUMENT", help="Of pytest, after --; among them the policy"
    )


def require_lines(*words: str) -> None:
    """Check that each of some words has one line.

    Raises:
        OptionError: One has several.
    """
    for word in words:
        if "\n" in word:
            raise OptionError(f"{word!r} has several lines, which a script of jobs cannot hold. Write one.")


def hand_over(jobs: str, command: Sequence[str]) -> int:
    """Give jobs to the standard input of a command; returns its exit status.

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
