"""``libero-max dev preflight``: the checks of the construction on the cases of a track or manifest."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands, add_substrate, manifest_of, option, whole_number
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.makers.arguments import add_examination, add_expert, examining


def add_command(commands: Commands) -> None:
    """Add ``preflight`` to the parser."""
    preflight = commands.add_parser("preflight", help="Examine the cases of a track or manifest")
    preflight.add_argument("cases", metavar="TRACK|MANIFEST", help="A track's name or a manifest's path")
    option(preflight, "--limit N", "Only N of them, spread evenly", type=whole_number(1))
    add_expert(preflight, default=None)
    add_examination(preflight)
    add_substrate(preflight)
    preflight.set_defaults(run=_preflight)


def _preflight(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.sampling import stratified
    from pytest_libero_max.makers.construction.overview import certificate_lines, preflight_lines

    cases = manifest_of(options.cases).cases
    if options.limit is not None:
        cases = stratified(cases, options.limit)
    with examining(options) as (_, examiner):
        preflights = examiner.examine(cases)
        say(preflight_lines(preflights))
        if options.expert is not None:
            passed = [case for case in cases if preflights[case.case_id].passed]
            say(["", *certificate_lines(examiner.certify(passed, options.expert))])
