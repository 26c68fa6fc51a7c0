"""``libero-max plan time``: time that pairs will take on a fleet, and its bottleneck."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import Commands, number, option, whole_number
from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pytest_libero_max.benchmark.cases import Case

_MOST = 1_000_000
"""Largest number of anything, and longest time, ms."""


def add_command(commands: Commands) -> None:
    """Add ``time`` to the parser."""
    plan = commands.add_parser(
        "time",
        help="Time that pairs will take with a number of workers and policy servers, and the bottleneck",
        description="Learns from the timings of a run what steps, images and queries take and how many of "
        "them each task needs, and computes how long the slowest part of a fleet takes. A worker is as fast "
        "as one of that run: each needs a processor core of its own. The start of the workers and of the "
        "policy, the collection and the final report come on top.",
    )
    plan.add_argument("run_folder", type=Path, metavar="RUN", help="The run that is learnt from")
    what = plan.add_mutually_exclusive_group()
    option(what, "--track NAME", "Track to play (default: the pairs of RUN)")
    option(what, "--manifest PATH", "The same, as a manifest", type=Path)
    option(plan, "--workers N", "Default: %(default)s", type=whole_number(1, _MOST), default=1)
    option(
        plan,
        "--servers N",
        "Policy servers (default: %(default)s, the policy is in each worker)",
        type=whole_number(0, _MOST),
        default=0,
    )
    option(plan, "--query-ms MS", "Time of a query (default: that in RUN)", type=number(0, _MOST))
    option(
        plan, "--batch N", "Queries that a server answers together", type=whole_number(1, _MOST), default=1
    )
    option(plan, "--batch-ms MS", "Time of a full batch (default: that of one query)", type=number(0, _MOST))
    option(
        plan,
        "--record-ms MS",
        "Time that the process that owns the run needs for a record",
        type=number(0, _MOST),
        default=2.5,
    )
    option(plan, "--shards N", "Also say how well so many shards share the work", type=whole_number(1, _MOST))
    plan.set_defaults(run=_plan)


def _plan(options: argparse.Namespace) -> None:
    from pytest_libero_max.lab.fleet import Fleet, plan_lines, shard_lines
    from pytest_libero_max.runs.plan import PlannedPair
    from pytest_libero_max.runs.store import read_pairs

    if options.batch > 1 and not options.servers:
        raise OptionError.seen(
            "--batch", options.batch, ", but only servers answer together. Give --servers."
        )
    stored = read_pairs(options.run_folder, ended=False)
    cases = _cases(options)
    what = options.track and f"track {options.track}"
    what = what or (str(options.manifest) if options.manifest else f"The pairs of {options.run_folder}")
    fleet = Fleet(
        workers=options.workers,
        servers=options.servers,
        query_s=None if options.query_ms is None else options.query_ms / 1e3,
        batch=options.batch,
        batch_s=None if options.batch_ms is None else options.batch_ms / 1e3,
        record_s=options.record_ms / 1e3,
    )
    pairs = stored.run.planned if cases is None else [PlannedPair.of(case) for case in cases]
    lines = plan_lines(stored, pairs, what, fleet)
    if options.shards is not None:
        if cases is None:
            raise OptionError.seen("--shards", options.shards, " also needs --track or --manifest.")
        lines += shard_lines(stored, cases, options.shards)
    say(lines)


def _cases(options: argparse.Namespace) -> Sequence[Case] | None:
    """Cases to play; None for the pairs of the run."""
    from pytest_libero_max.benchmark.manifests import load_manifest
    from pytest_libero_max.benchmark.tracks import load_track

    if options.track is not None:
        return load_track(options.track).cases
    return None if options.manifest is None else load_manifest(options.manifest).cases
