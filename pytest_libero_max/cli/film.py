"""``libero-max film``: films of recorded pairs, which are played again for them."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.benchmark.documents import printable
from pytest_libero_max.cli.arguments import Commands, add_libero, option, switch, whole_number
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.runs.media import FILM_FORMATS, FILM_SELECTIONS, VIEWS, selection_named

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.benchmark.documents import Json
    from pytest_libero_max.films.recorded import Drawn
    from pytest_libero_max.pairing.record import PairRecord
    from pytest_libero_max.pairing.trace import ArmTrace
    from pytest_libero_max.worlds.contract import World


def add_command(commands: Commands) -> None:
    """Add ``film`` to the parser."""
    film = commands.add_parser(
        "film",
        help="Film pairs of a run: all arms side by side, both cameras",
        description="The recorded actions are played again, anywhere; a film is only made if the replay "
        "reaches the recorded digests. The run must have kept traces (--libero-max-traces). Without the "
        "extra film (PyAV), films are animated WebP. Exit status 1 if a film was refused.",
    )
    add_pairs(film, "films")
    option(film, "--format", "Default: mp4 if PyAV is installed, otherwise webp", choices=FILM_FORMATS)
    option(
        film,
        "--view",
        "world, or policy: the images of its queries, or of every step if it sees those, "
        "after the world's noise and, where a profile or --adapter tells, after preprocessing",
        default="world",
        choices=VIEWS,
    )
    option(
        film,
        "--adapter POLICY",
        "With --view=policy: load the adapter of the run and show what its model_inputs returns",
    )
    option(
        film,
        "--profile NAME|PATH",
        "With --view=policy: the profile of the run's server, if it is none of this package's",
    )
    film.add_argument("--in-view", action="store_true", help=argparse.SUPPRESS)  # view shows them itself
    film.set_defaults(run=_film)


def add_pairs(command: argparse.ArgumentParser, folder: str) -> None:
    """Add the arguments for the pairs to play again, their pictures, and the place of the files.

    Args:
        folder: Name of the folder for its files, in the folder of the run.
    """
    command.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    command.add_argument(
        "cases",
        nargs="*",
        metavar="CASE",
        help="Names of pairs, or expressions as for pytest -k: 'camera_shift and v1' (default: see --select)",
    )
    option(
        command,
        "--select",
        "Without CASE: pairs that only Base completes, whose outcomes differ, or all that have traces",
        type=selection_named,
        default="regressions",
        choices=FILM_SELECTIONS,
    )
    option(command, "--output FOLDER", f"Folder for the files (default: {folder} in RUN)", type=Path)
    option(command, "--size PX", "Side of a picture", type=whole_number(32), default=256)
    option(command, "--every STEPS", "Show every so many steps", type=whole_number(1), default=2)
    switch(command, "--overwrite", "Replace files that are there already")
    option(
        command,
        "--cases TRACK|MANIFEST",
        "The cases of the run, if it played no frozen track",
        dest="case_set",
    )
    add_libero(command)


def _film(options: argparse.Namespace) -> int:
    from pytest_libero_max.films.policy_view import shown_by
    from pytest_libero_max.films.recorded import film_pair, film_path

    of_policy = options.view == "policy"
    if not of_policy and (options.adapter or options.profile):
        raise OptionError("--adapter and --profile say what the policy saw: give --view=policy as well.")
    report = f"libero-max view {options.run_folder} shows them beside their cases."
    return write_each(
        options,
        "films",
        lambda folder, record: film_path(folder, record, options.format, options.view),
        lambda ran: partial(
            film_pair, shown=shown_by(ran["policy"], options.adapter, options.profile) if of_policy else None
        ),
        "" if of_policy or options.in_view else report,
        for_people=not of_policy,
    )


def write_each(
    options: argparse.Namespace,
    name: str,
    path_of: Callable[[Path, PairRecord], Path],
    writer: Callable[[Json], Callable[..., None]],
    then: str = "",
    *,
    for_people: bool = False,
) -> int:
    """Play the chosen pairs again and write a file for each; return 1 if one was refused, else 0."""
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.films.recorded import Drawn, chosen, open_recorded
    from pytest_libero_max.runs.outside import require_inside

    where = options.run_folder, options.case_set, options.libero, options.libero_assets
    how = Drawn(options.size, options.every, options.overwrite)
    refused = 0
    with open_recorded(*where, for_people=for_people) as run, Work() as work:
        records = chosen(run.stored, options.cases, options.select)
        write = writer(run.stored.run.provenance)
        for note in filter(None, (run.outside, run.drawn_differently())):
            work.say(printable(note))
        for number, record in enumerate(records, start=1):
            path = path_of(options.output or require_inside(run.folder, run.folder / name), record)
            place, begin = f"{number}/{len(records)}", time.perf_counter()
            if path.exists() and not options.overwrite:
                work.say(f"{place} {path} is there already; --overwrite makes it again")
                continue
            reporting = replace(how, on_step=partial(_tell, work, number - 1, len(records), record))
            try:
                run.again(record, partial(_write, write, path, record, reporting))
            except LiberoMaxError as error:
                refused += 1
                work.say(f"{place} refused: {error}")
            else:
                seconds, kilobytes = time.perf_counter() - begin, path.stat().st_size / 1000
                work.say(f"{place} {path} ({kilobytes:.0f} kB, {seconds:.1f} s)")
    if not records:
        print(f"No pair of this run is selected by --select={options.select}.")
    if then and len(records) > refused and options.output is None:
        print(then)
    return 1 if refused else 0


def _write(
    write: Callable[..., None],
    path: Path,
    record: PairRecord,
    how: Drawn,
    case: Case,
    world: World,
    traces: Mapping[str, ArmTrace],
) -> None:
    write(path, case, world, record, traces, how)


def _tell(work: Work, before: int, files: int, record: PairRecord, step: int) -> None:
    """Show how far the work is."""
    steps = max(arm.steps for arm in record.arms.values())
    left = work.left(before + step / max(steps, 1), files)
    work.show(f"{before + 1} of {files}, step {step} of {steps}{left}: {record.item_id}")
