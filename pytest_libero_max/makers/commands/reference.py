"""``libero-max dev reference``: a task as LIBERO plays it, which environments of others are compared with."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands, add_substrate, substrate_options
from pytest_libero_max.errors import SubstrateError


def add_command(commands: Commands) -> None:
    """Add ``reference`` to the parser."""
    reference = commands.add_parser(
        "reference", help="Record what LIBERO does in a task, for --libero-max-conform=env:..."
    )
    reference.add_argument("task", metavar="SUITE/NUMBER", help="For example libero_spatial/0")
    reference.add_argument("file", type=Path, metavar="FILE", help="The reference, JSON")
    add_substrate(reference)
    reference.set_defaults(run=_reference)


def _reference(options: argparse.Namespace) -> None:
    from pytest_libero_max.benchmark.structs import to_builtins
    from pytest_libero_max.benchmark.tracks import load_track
    from pytest_libero_max.conformance.environment.reference import record
    from pytest_libero_max.events.schedules import BASE, Arm
    from pytest_libero_max.pairing.runner import measure_pair
    from pytest_libero_max.policies.loading import load_policy
    from pytest_libero_max.substrates.registry import open_substrate
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()
    suite, _, number = options.task.partition("/")
    cases = (case for case in load_track("original").cases if case.suite == suite)
    case = next((case for case in cases if str(case.task_index) == number), None)
    if case is None:
        raise SubstrateError.seen("task", options.task, ", but the track original has no case of it.")
    substrate = open_substrate(options.substrate.name, substrate_options(options))
    world = substrate.world(case)
    pair = measure_pair(case, world, load_policy("expert"), arms=(Arm(BASE),))
    reference = record(
        world,
        pair.base.actions,
        task=options.task,
        init=case.init_state_index,
        versions=dict(substrate.fingerprint(images=True)),
    )
    substrate.close()
    options.file.write_text(json.dumps(to_builtins(reference), indent=1) + "\n", encoding="utf-8")
    print(f"{options.task}: solved in {reference.success_step} steps. Written: {options.file}")
