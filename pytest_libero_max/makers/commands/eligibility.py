"""``libero-max dev eligibility``: number of variations that can host each event."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands, add_substrate
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.makers.arguments import add_classification, catalogue_of


def add_command(commands: Commands) -> None:
    """Add ``eligibility`` to the parser."""
    eligibility = commands.add_parser(
        "eligibility", help="Count the variations that can host each event, by source category"
    )
    add_classification(eligibility)
    add_substrate(eligibility)
    eligibility.set_defaults(run=_eligibility)


def _eligibility(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.configurations import eligibility_lines

    say(eligibility_lines(catalogue_of(options)))
