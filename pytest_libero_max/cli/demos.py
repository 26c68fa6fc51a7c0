"""``libero-max demos``: episodes of the scripted expert as training data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.identity import FROZEN_STATES, TRAINING_STATES
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import OptionError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

SUITES = ("libero_spatial", "libero_object", "libero_goal", "libero_10")


def add_command(commands: Commands) -> None:
    """Add ``demos`` to the parser."""
    demos = commands.add_parser(
        "demos",
        help="Record episodes of the scripted expert on the embedded scenes as training data",
        description="One .npz for each episode in which the expert completes the task, with both cameras and "
        "the state before every action; with --events, also its recoveries from events. No frozen case "
        "begins from the initial states that are recorded. Interrupted, it goes on where it stopped; the "
        "same command gives the same bytes. With --run, the pairs of a run are written in the same format.",
    )
    demos.add_argument("folder", type=Path, metavar="FOLDER", help="Folder for the episodes")
    demos.add_argument(
        "--suites", nargs="+", default=list(SUITES), choices=SUITES, metavar="SUITE", help="Default: all four"
    )
    demos.add_argument("--tasks", type=int, nargs="+", metavar="INDEX", help="Of each suite (default: all)")
    demos.add_argument(
        "--inits",
        type=int,
        nargs="+",
        default=list(TRAINING_STATES[:10]),
        metavar="INDEX",
        help=f"Initial states of a task, from {TRAINING_STATES[0]} to {TRAINING_STATES[-1]} (default: "
        f"{TRAINING_STATES[0]} to {TRAINING_STATES[9]}). {FROZEN_STATES[0]} to {FROZEN_STATES[-1]} are those "
        "of the frozen cases, and refused",
    )
    demos.add_argument(
        "--events",
        nargs="*",
        metavar="EVENT",
        help="For each initial state, also one episode with each of these events, in which the expert has to "
        "recover; without names, with all eight (default: none)",
    )
    demos.add_argument(
        "--image-size", type=int, default=128, metavar="PX", help="Side of an image (default: %(default)s)"
    )
    demos.add_argument(
        "--expert", default="expert", metavar="POLICY", help="As for pytest --libero-max-policy"
    )
    demos.add_argument(
        "--disturb",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="Push the hand aside after this share of the queries, until the next one, so that the episodes "
        "show how to come back. The recorded action is the expert's, not the push (default: %(default)s)",
    )
    demos.add_argument(
        "--run",
        type=Path,
        dest="run_folder",
        metavar="RUN",
        help="Instead of playing the expert, write both arms of each pair of this run that has traces, "
        "completed or not",
    )
    demos.add_argument("--jobs", type=int, default=2, metavar="N", help="Processes (default: %(default)s)")
    demos.add_argument(
        "--lerobot",
        type=Path,
        metavar="FOLDER",
        help="Afterwards, write all episodes as a dataset of LeRobot, format 3.0 (extra demos)",
    )
    demos.set_defaults(run=_demos)


def _demos(options: argparse.Namespace) -> None:
    if options.lerobot is not None:
        from pytest_libero_max.demos.lerobot import require_pyarrow

        require_pyarrow()
    for name in ("image_size", "jobs"):
        if getattr(options, name) < 1:
            raise OptionError(
                f"--{name.replace('_', '-')} is {getattr(options, name)}, but must be at least 1."
            )
    if not 0.0 <= options.disturb <= 1.0:
        raise OptionError(f"--disturb is {options.disturb}, but must be from 0 to 1.")
    for init in options.inits:
        if init in FROZEN_STATES:
            raise OptionError(
                f"--inits {init}: frozen cases begin from that state, and a policy that was trained on it is "
                f"no longer tested by them. Give states from {TRAINING_STATES[0]} to {TRAINING_STATES[-1]}."
            )
    paths = _of_run(options) if options.run_folder else _of_expert(options)
    if options.lerobot is not None:
        from pytest_libero_max.demos.lerobot import write_dataset

        write_dataset(paths, options.lerobot)
        print(f"Dataset of LeRobot in {options.lerobot}.")


def _of_run(options: argparse.Namespace) -> list[Path]:
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.demos.evaluated import collect_run

    with Work() as work:

        def tell(done: int, total: int) -> None:
            work.show(f"{done} of {total} pairs written{work.left(done, total)}", last=done == total)

        paths, left_out = collect_run(options.run_folder, options.folder, options.image_size, tell)
    print(
        f"Episodes in {options.folder}: {len(paths)}. Pairs without traces: {left_out}. The run's own cases "
        "no longer test a policy that is trained on them."
    )
    return paths


def _of_expert(options: argparse.Namespace) -> list[Path]:
    from pytest_libero_max.demos.episodes import planned
    from pytest_libero_max.demos.folder import Settings, collect
    from pytest_libero_max.events.registry import BENCHMARK_EVENTS

    events = () if options.events is None else options.events or BENCHMARK_EVENTS
    plans = list(planned(options.suites, options.tasks, options.inits, events))
    settings = Settings(options.expert, options.image_size, disturbed=options.disturb)
    before: list[int] = []
    with Work() as work:

        def tell(done: int, total: int) -> None:
            before.append(done)
            left = work.left(done - before[0], total - before[0])
            work.show(f"{done} of {total} episodes played{left}", last=done == total)

        found = collect(plans, options.folder, settings, options.jobs, tell)
    paths = [item.path for item in found if item.path is not None]
    print(
        f"Episodes in {options.folder}: {len(paths)}. The expert did not complete: {len(found) - len(paths)}."
    )
    return paths
