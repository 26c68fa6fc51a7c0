"""``libero-max film``: films of recorded pairs, which are played again for them."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pytest_libero_max.cli.arguments import add_libero
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.runs.media import FILM_FORMATS, FILM_SELECTIONS, VIEWS

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.benchmark.documents import Json
    from pytest_libero_max.pairing.record import PairRecord
    from pytest_libero_max.pairing.trace import ArmTrace
    from pytest_libero_max.worlds.contract import World

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


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
    film.add_argument(
        "--format", choices=FILM_FORMATS, help="Default: mp4 if PyAV is installed, otherwise webp"
    )
    film.add_argument(
        "--view",
        default="world",
        choices=VIEWS,
        help="world, or policy: the images of its queries, or of every step if it sees those, "
        "after the world's noise and, where a profile or --adapter tells, after preprocessing (default: "
        "%(default)s)",
    )
    film.add_argument(
        "--adapter",
        metavar="POLICY",
        help="With --view=policy: load the adapter of the run and show what its model_inputs returns",
    )
    film.add_argument(
        "--profile",
        metavar="NAME|PATH",
        help="With --view=policy: the profile of the run's server, if it is none of this package's",
    )
    film.set_defaults(run=_film)


def add_pairs(command: argparse.ArgumentParser, folder: str) -> None:
    """Add the arguments of :func:`add_choice`, and those for pictures.

    Args:
        command: The command.
        folder: As there.
    """
    add_choice(command, folder)
    command.add_argument(
        "--size", type=int, default=256, metavar="PX", help="Side of a picture (default: %(default)s)"
    )
    command.add_argument(
        "--every",
        type=int,
        default=2,
        metavar="STEPS",
        help="Show every so many steps (default: %(default)s)",
    )


def add_choice(command: argparse.ArgumentParser, folder: str) -> None:
    """Add the arguments for the pairs to play again, and for the place of the files.

    Args:
        command: The command.
        folder: Name of the folder for its files, in the folder of the run.
    """
    command.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    command.add_argument("cases", nargs="*", metavar="CASE", help="Ids of pairs (default: see --select)")
    command.add_argument(
        "--select",
        default="regressions",
        choices=FILM_SELECTIONS,
        help="Without CASE: pairs that only Base completes, whose outcomes differ, or all that have traces "
        "(default: %(default)s)",
    )
    command.add_argument(
        "--output", type=Path, metavar="FOLDER", help=f"Folder for the files (default: {folder} in RUN)"
    )
    command.add_argument("--overwrite", action="store_true", help="Replace files that are there already")
    command.add_argument(
        "--cases",
        dest="case_set",
        metavar="TRACK|MANIFEST",
        help="The cases, if they are not where the run says",
    )
    add_libero(command)


def _film(options: argparse.Namespace) -> int:
    from pytest_libero_max.films.policy_view import shown_by
    from pytest_libero_max.films.recorded import film_pair, film_path

    of_policy = options.view == "policy"
    if not of_policy and (options.adapter or options.profile):
        raise OptionError("--adapter and --profile say what the policy saw: give --view=policy as well.")
    made = write_each(
        options,
        "films",
        lambda folder, record: film_path(folder, record, options.format, options.view),
        lambda ran: partial(
            film_pair, shown=shown_by(ran["policy"], options.adapter, options.profile) if of_policy else None
        ),
    )
    if made.files and options.output is None and not of_policy:
        print(f"libero-max report {options.run_folder} links the films in report.html.")
    return made.exit_status


class _Made(NamedTuple):
    """Numbers of files that are there, and that were refused.

    Attributes:
        files: Number of files that are there.
        refused: Number of pairs whose file could not be made.
    """

    files: int
    refused: int

    @property
    def exit_status(self) -> int:
        return 1 if self.refused else 0


def write_each(
    options: argparse.Namespace,
    name: str,
    path_of: Callable[[Path, PairRecord], Path],
    how: Callable[[Json], Callable[..., None]],
) -> _Made:
    """Play the chosen pairs again and write a file for each.

    Args:
        options: See :func:`add_pairs`.
        name: Of the folder for the files, in that of the run.
        path_of: Path of the file of a pair, in a folder.
        how: Writer of the file for a run with this provenance.
    """
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.films.recorded import chosen, open_recorded

    for option, least in (("size", 32), ("every", 1)):
        if getattr(options, option) < least:
            raise OptionError.seen(
                f"--{option}", getattr(options, option), f", but must be at least {least}."
            )
    where = options.run_folder, options.case_set, options.libero, options.libero_assets
    how_drawn = {"size": options.size, "every": options.every, "overwrite": options.overwrite}
    refused = 0
    with open_recorded(*where) as run, Work() as work:
        records = chosen(run.stored, options.cases, options.select)
        write = how(run.stored.run.provenance)
        if (renderer := run.drawn_differently()) is not None:
            work.say(renderer)
        for number, record in enumerate(records, start=1):
            path = path_of(options.output or run.folder / name, record)
            place, begin = f"{number}/{len(records)}", time.perf_counter()
            if path.exists() and not options.overwrite:
                work.say(f"{place} {path} is there already; --overwrite makes it again")
                continue
            told = partial(_tell, work, number - 1, len(records), record)
            try:
                run.again(record, partial(_write, write, path, record, told, how_drawn))
            except LiberoMaxError as error:
                refused += 1
                work.say(f"{place} refused: {error}")
            else:
                seconds, kilobytes = time.perf_counter() - begin, path.stat().st_size / 1000
                work.say(f"{place} {path} ({kilobytes:.0f} kB, {seconds:.1f} s)")
    if not records:
        print(f"No pair of this run is selected by --select={options.select}.")
    return _Made(len(records) - refused, refused)


def _write(
    write: Callable[..., None],
    path: Path,
    record: PairRecord,
    told: Callable[[int], None],
    how_drawn: Json,
    case: Case,
    world: World,
    traces: Mapping[str, ArmTrace],
) -> None:
    write(path, case, world, record, traces, on_step=told, **how_drawn)


def _tell(work: Work, before: int, files: int, record: PairRecord, step: int) -> None:
    """Show how far the work is.

    Args:
        work: Display of the progress.
        before: Files that are finished.
        files: All files.
        record: The pair that is being played again.
        step: Policy steps of it that are drawn.
    """
    steps = max(arm.steps for arm in record.arms.values())
    left = work.left(before + step / max(steps, 1), files)
    work.show(f"{before + 1} of {files}, step {step} of {steps}{left}: {record.item_id}")
