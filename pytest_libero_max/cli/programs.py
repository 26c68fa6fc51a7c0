"""``libero-max list programs``: the programs that can be laid over the cases of a run."""

from __future__ import annotations

import argparse
import json
import textwrap
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.terminal import say

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.programs import Program


def add_command(commands: Commands) -> None:
    """Add ``programs`` to the parser."""
    programs = commands.add_parser(
        "programs",
        help="List the programs of events that come with the package, or show one",
        description="Without a name, what each plays and which cases it fits; with one, also its arms "
        "and the command to play it.",
    )
    programs.add_argument("program", nargs="?", metavar="NAME|FILE", help="The program to show")
    programs.set_defaults(run=_programs)


def _programs(options: argparse.Namespace) -> int:
    from pytest_libero_max.benchmark.programs import find_program, program_names

    if options.program is None:
        say(line for name in program_names() for line in _lines(find_program(name)))
        return 0
    program = find_program(options.program)
    say(
        [
            *_lines(program),
            *_arms(program),
            f"pytest --libero-max-policy=POLICY --libero-max-program={program.source}",
        ]
    )
    return 0


def _lines(program: Program) -> Iterator[str]:
    """Yield the name of a program, what it plays, and which cases it fits."""
    yield f"{program.name}:"
    fits = [*_patterns("with", program.only), *_patterns("without", program.without)]
    limits = f"Cases {', '.join(fits)}: {program.because}" if fits else "All cases."
    for text in (program.about, limits):
        yield from textwrap.wrap(text, 100, initial_indent="  ", subsequent_indent="  ")


def _patterns(word: str, patterns: Mapping[str, tuple[str, ...]]) -> Iterator[str]:
    for key, values in patterns.items():
        yield f"{word} {key} {' or '.join(values)}"


def _arms(program: Program) -> Iterator[str]:
    """Yield the arms that are spelled out, an entry a line, as their file has them."""
    for arm in program.arms:
        others = {key: value for key, value in arm.items() if key not in ("name", "schedule")}
        yield f"  arm {arm['name']}{f' {json.dumps(others)}' if others else ''}"
        for index, entry in enumerate(arm.get("schedule", ())):
            yield f"    {index}. {json.dumps(entry)}"
