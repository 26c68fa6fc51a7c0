"""``libero-max dev eligibility``: number of variations or tasks that can host each event."""

from __future__ import annotations

import argparse

from pytest_libero_max.cli.arguments import Commands, add_substrate, substrate_options
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.makers.arguments import add_classification, catalogue_of


def add_command(commands: Commands) -> None:
    """Add ``eligibility`` to the parser."""
    eligibility = commands.add_parser(
        "eligibility", help="Count the variations, or the unmodified tasks, that can host each event"
    )
    add_classification(eligibility)
    add_substrate(eligibility)
    eligibility.set_defaults(run=_eligibility)


def _eligibility(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.construction.configurations import eligibility_lines
    from pytest_libero_max.makers.construction.unmodified_tracks import Population, hosting_lines
    from pytest_libero_max.substrates.registry import SUBSTRATES

    kind, settings = SUBSTRATES[options.substrate.name], substrate_options(options)
    if kind.tracks(settings).per_event:
        say(hosting_lines(Population(kind, settings)))
    else:
        say(eligibility_lines(catalogue_of(options)))
