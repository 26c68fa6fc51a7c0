"""``libero-max dev bench``: speed of steps, scenes, images, pairs and a policy server on this machine."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from pytest_libero_max.cli.arguments import (
    Commands,
    add_libero,
    add_substrate,
    number,
    option,
    substrate_options,
    whole_number,
)
from pytest_libero_max.cli.work import Work
from pytest_libero_max.tasks.suites import LIBERO_SUITES


def add_command(commands: Commands) -> None:
    """Add ``bench`` with its parts to the parser."""
    bench = commands.add_parser("bench", help="Measure this machine: pairs, scenes, device or genuine")
    parts = bench.add_subparsers(required=True, metavar="WHAT")
    _add_pairs(parts)
    scenes = parts.add_parser("scenes", help="What each of the forty scenes costs")
    add_substrate(scenes)
    scenes.set_defaults(run=_bench_scenes)
    _add_device(parts)
    _add_genuine(parts)


def _add_pairs(parts: Commands) -> None:
    pairs = parts.add_parser("pairs", help="Stepping, rendering and pairs side by side with robosuite")
    option(
        pairs, "--scene SUITE/TASK", "Default: libero_spatial/0", type=_scene, default=("libero_spatial", 0)
    )
    option(pairs, "--steps N", "Control steps", type=whole_number(1), default=100)
    option(pairs, "--repeats N", "Pairs; with 0, steps and images alone", type=whole_number(0), default=3)
    pairs.set_defaults(run=_bench_pairs)


def _add_device(parts: Commands) -> None:
    device = parts.add_parser(
        "device",
        help="What this machine's GPU draws and serves beside its processor, as one file to send",
        description="Measures images a second of embedded scenes, and of genuine ones where LIBERO is "
        "installed: by the device that draws here, and by the processor where that is another one. Says "
        "whether images are the same bit for bit where everything is drawn, and in another process. Then "
        "one policy server is asked by several clients at once. Run it where nothing else runs; with the "
        "defaults and a GPU it takes about ten minutes.",
    )
    option(
        device,
        "--scenes SUITE/TASK",
        "Default: task 0 of each suite",
        nargs="+",
        type=_scene,
        default=[(suite, 0) for suite in ("libero_spatial", "libero_object", "libero_goal", "libero_10")],
    )
    option(
        device,
        "--workers N",
        "Numbers of processes that draw, or ask, at once (default: 1 2 4)",
        nargs="+",
        type=whole_number(1),
        default=[1, 2, 4],
    )
    option(device, "--seconds S", "Time for each measurement", type=number(0.001, 3600), default=5.0)
    option(
        device,
        "--policy POLICY",
        "Policy to serve, as for pytest --libero-max-policy (default: one that answers at once)",
    )
    option(
        device,
        "--output FILE",
        "The file to send; it names neither the machine nor its user",
        type=Path,
        default=Path("device.md"),
    )
    add_libero(device)
    device.set_defaults(run=_bench_device)


def _add_genuine(parts: Commands) -> None:
    genuine = parts.add_parser(
        "genuine", help="Steps and a pair side by side with an installed LIBERO's environment"
    )
    option(genuine, "--suite SUITE", "Default: %(default)s", choices=LIBERO_SUITES, default="libero_spatial")
    option(genuine, "--steps N", "Control steps", type=whole_number(1), default=60)
    option(genuine, "--repeats N", "Pairs", type=whole_number(1), default=1)
    add_libero(genuine)
    genuine.set_defaults(run=_bench_genuine)


def _scene(text: str) -> tuple[str, int]:
    suite, _, index = text.partition("/")
    if not (suite in LIBERO_SUITES and index.isdigit() and int(index) < 10):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no scene: expected SUITE/TASK, one of {', '.join(LIBERO_SUITES)} and 0 to 9"
        )
    return suite, int(index)


def _bench_device(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.bench.device_report import Plan, device_report

    plan = Plan(substrate_options(options), options.scenes, options.workers, options.seconds, options.policy)
    with options.output.open("w") as file, Work() as work:
        for line in device_report(plan, lambda what: work.show(f"Measuring {what}")):
            file.write(f"{line}\n")
            file.flush()
    print(options.output.read_text(), end="")
    print(f"\nWritten: {options.output}")


def _bench_pairs(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.bench.pair_runner import measure_pairs
    from pytest_libero_max.makers.bench.step_speed import measure_stepping

    suite, index = options.scene
    print("\n".join(measure_stepping(suite, index, steps=options.steps).lines()), flush=True)
    if options.repeats:
        print("\n".join(measure_pairs(suite, index, repeats=options.repeats).lines()))


def _bench_scenes(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.bench.scenes import SCENES, cost_lines, measure_scenes, scenes_of
    from pytest_libero_max.substrates.registry import open_substrate

    open_scene = scenes_of(open_substrate(options.substrate.name, substrate_options(options)))
    costs = []
    with Work() as work:
        work.show(f"0 of {SCENES} scenes measured")
        for cost in measure_scenes(open_scene):
            costs.append(cost)
            work.show(f"{len(costs)} of {SCENES} scenes measured{work.left(len(costs), SCENES)}")
    print("\n".join(cost_lines(costs)))


def _bench_genuine(options: argparse.Namespace) -> None:
    from pytest_libero_max.makers.bench.genuine_speed import measure_genuine
    from pytest_libero_max.substrates.libero.installation import find_installations
    from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate

    installations = find_installations(options.libero, assets=options.libero_assets)
    with closing(LiberoSubstrate(installations)) as substrate:
        times = measure_genuine(substrate, options.suite, steps=options.steps, repeats=options.repeats)
    print("\n".join(times.lines()))
