"""``libero-max lab demos``: episodes of the scripted expert as training data."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_libero_max.benchmark.identity import FROZEN_STATES, TRAINING_STATES
from pytest_libero_max.cli.arguments import Commands, add_jobs, add_libero, number, option, whole_number
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import OptionError, counted
from pytest_libero_max.tasks.suites import LIBERO_SUITES


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
    option(
        demos,
        "--suites SUITE",
        "Default: all four",
        nargs="+",
        default=list(LIBERO_SUITES),
        choices=LIBERO_SUITES,
    )
    option(demos, "--tasks INDEX", "Of each suite (default: all)", type=int, nargs="+")
    option(
        demos,
        "--inits INDEX",
        f"Initial states of a task, from {TRAINING_STATES[0]} to {TRAINING_STATES[-1]} (default: "
        f"{TRAINING_STATES[0]} to {TRAINING_STATES[9]}). {FROZEN_STATES[0]} to {FROZEN_STATES[-1]} are those "
        "of the frozen cases, and refused",
        type=int,
        nargs="+",
        default=list(TRAINING_STATES[:10]),
    )
    option(
        demos,
        "--events EVENT",
        "For each initial state, also one episode with each of these events, in which the expert has to "
        "recover; without names, with all eight (default: none)",
        nargs="*",
    )
    option(demos, "--image-size PX", "Side of an image", type=whole_number(1), default=128)
    option(demos, "--expert POLICY", "As for pytest --libero-max-policy", default="expert")
    option(
        demos,
        "--disturb SHARE",
        "Push the hand aside after this share of the queries, until the next one, so that the episodes "
        "show how to come back. The recorded action is the expert's, not the push",
        type=number(0, 1),
        default=0.0,
    )
    option(
        demos,
        "--run RUN",
        "Instead of playing the expert, write both arms of each pair of this run that has traces, "
        "completed or not",
        type=Path,
        dest="run_folder",
    )
    option(
        demos,
        "--cases TRACK|MANIFEST",
        "With --run: its cases, if it played no frozen track",
        dest="case_set",
    )
    add_libero(demos)
    add_jobs(demos)
    option(
        demos,
        "--lerobot FOLDER",
        "Afterwards, write all episodes as a dataset of LeRobot, format 3.0 (extra demos)",
        type=Path,
    )
    demos.set_defaults(run=_demos)


def _demos(options: argparse.Namespace) -> None:
    if options.lerobot is not None:
        from pytest_libero_max.lab.demos.lerobot import require_pyarrow

        require_pyarrow()
    for init in options.inits:
        if init in FROZEN_STATES:
            raise OptionError(
                f"--inits {init}: frozen cases begin from that state, and a policy that was trained on it is "
                f"no longer tested by them. Give states from {TRAINING_STATES[0]} to {TRAINING_STATES[-1]}."
            )
    paths = _of_run(options) if options.run_folder else _of_expert(options)
    if options.lerobot is not None:
        from pytest_libero_max.lab.demos.lerobot import write_dataset

        write_dataset(paths, options.lerobot)
        print(f"Dataset of LeRobot in {options.lerobot}.")


def _of_run(options: argparse.Namespace) -> list[Path]:
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.lab.demos.evaluated import collect_run

    with Work() as work:

        def tell(done: int, total: int) -> None:
            work.show(
                f"{done} of {counted(total, 'pair')} written{work.left(done, total)}", last=done == total
            )

        paths, left_out = collect_run(
            options.run_folder,
            options.folder,
            options.image_size,
            tell,
            cases=options.case_set,
            installations=options.libero,
            assets=options.libero_assets,
        )
    print(
        f"Episodes in {options.folder}: {len(paths)}. Pairs without traces: {left_out}. The run's own cases "
        "no longer test a policy that is trained on them."
    )
    return paths


def _of_expert(options: argparse.Namespace) -> list[Path]:
    from pytest_libero_max.events.registry import BENCHMARK_EVENTS
    from pytest_libero_max.lab.demos.episodes import planned
    from pytest_libero_max.lab.demos.folder import Settings, collect

    events = () if options.events is None else options.events or BENCHMARK_EVENTS
    plans = list(planned(options.suites, options.tasks, options.inits, events))
    settings = Settings(options.expert, options.image_size, disturbed=options.disturb)
    before: list[int] = []
    with Work() as work:

        def tell(done: int, total: int) -> None:
            before.append(done)
            left = work.left(done - before[0], total - before[0])
            work.show(f"{done} of {counted(total, 'episode')} played{left}", last=done == total)

        found = collect(plans, options.folder, settings, options.jobs, tell)
    paths = [item.path for item in found if item.path is not None]
    print(
        f"Episodes in {options.folder}: {len(paths)}. The expert did not complete: {len(found) - len(paths)}."
    )
    return paths
