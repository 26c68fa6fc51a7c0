"""``libero-max plan``: time that pairs will take on a fleet, and its bottleneck."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.terminal import say
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pytest_libero_max.benchmark.cases import Case

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``plan`` to the parser."""
    plan = commands.add_parser(
        "plan",
        help="Time that pairs will take with a number of workers and policy servers, and the bottleneck",
        description="Learns from the timings of a run what steps, images and queries take and how many of "
        "them each task needs, and computes how long the slowest part of a fleet takes. A worker is as fast "
        "as one of that run: each needs a processor core of its own. The start of the workers and of the "
        "policy, the collection and the final report come on top.",
    )
    plan.add_argument("run_folder", type=Path, metavar="RUN", help="The run that is learnt from")
    what = plan.add_mutually_exclusive_group()
    what.add_argument("--track", metavar="NAME", help="Track to play (default: the pairs of RUN)")
    what.add_argument("--manifest", type=Path, metavar="PATH", help="The same, as a manifest")
    plan.add_argument("--workers", type=int, default=1, metavar="N", help="Default: %(default)s")
    plan.add_argument(
        "--servers",
        type=int,
        default=0,
        metavar="N",
        help="Policy servers (default: %(default)s, the policy is in each worker)",
    )
    plan.add_argument(
        "--query-ms",
        type=float,
        metavar="MS",
        help="Time of a query (default: that in RUN)",
    )
    plan.add_argument(
        "--batch",
        type=int,
        default=1,
        metavar="N",
        help="Queries that a server answers together (default: %(default)s)",
    )
    plan.add_argument(
        "--batch-ms", type=float, metavar="MS", help="Time of a full batch (default: that of one query)"
    )
    plan.add_argument(
        "--record-ms",
        type=float,
        default=2.5,
        metavar="MS",
        help="Time that the process that owns the run needs for a record (default: %(default)s)",
    )
    plan.add_argument(
        "--shards", type=int, metavar="N", help="Also say how well so many shards share the work"
    )
    plan.set_defaults(run=_plan)


def _plan(options: argparse.Namespace) -> None:
    from pytest_libero_max.costs.fleet import Fleet
    from pytest_libero_max.report.writers.plan_text import plan_lines, shard_lines
    from pytest_libero_max.runs.plan import PlannedPair
    from pytest_libero_max.runs.store import read_pairs

    _check(options)
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


_LEAST = {"workers": 1, "servers": 0, "batch": 1, "shards": 1, "query_ms": 0.0, "record_ms": 0.0}
_MOST = 1_000_000


def _check(options: argparse.Namespace) -> None:
    for name, least in {**_LEAST, "batch_ms": 0.0}.items():
        value = getattr(options, name)
        if value is not None and not least <= value <= _MOST:
            flag = f"--{name.replace('_', '-')}"
            raise OptionError.seen(flag, value, f", but must be a number from {least} to {_MOST}.")
    if options.batch > 1 and not options.servers:
        raise OptionError.seen(
            "--batch", options.batch, ", but only servers answer together. Give --servers."
        )
