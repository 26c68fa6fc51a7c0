"""The command that films recorded pairs: film."""

from __future__ import annotations

import argparse
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.substrates import add_libero
from pytest_libero_max.cli.work import Work
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.report.media import FILM_FORMATS, FILM_SELECTIONS, VIEWS

if TYPE_CHECKING:
    from pytest_libero_max.pairing.record import PairRecord

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_commands(commands: Commands) -> None:
    """Add ``film`` to the parser."""
    film = commands.add_parser(
        "film",
        help="Film pairs of a run: all arms side by side, both cameras",
        description="The recorded actions are played again, anywhere; a film is only made if the replay "
        "reaches the recorded digests. The run must have kept traces (--libero-max-traces). Without the "
        "extra film (PyAV), films are animated WebP. Exit status 1 if a film was refused.",
    )
    film.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    film.add_argument("cases", nargs="*", metavar="CASE", help="Ids of pairs (default: see --select)")
    film.add_argument(
        "--select",
        default="regressions",
        choices=FILM_SELECTIONS,
        help="Without CASE: pairs that only Base completes, whose outcomes differ, or all that have traces "
        "(default: %(default)s)",
    )
    film.add_argument(
        "--output", type=Path, metavar="FOLDER", help="Where films are written (default: films in RUN)"
    )
    film.add_argument(
        "--size", type=int, default=256, metavar="PX", help="Side of a picture (default: %(default)s)"
    )
    film.add_argument(
        "--every", type=int, default=1, metavar="STEPS", help="Show every so many steps (default: 1)"
    )
    film.add_argument(
        "--format", choices=FILM_FORMATS, help="Default: mp4 if PyAV is installed, otherwise webp"
    )
    film.add_argument(
        "--view",
        default="world",
        choices=VIEWS,
        help="world, or what the policy saw: the images of its queries, after the world's noise and, where a "
        "profile or --adapter tells, after preprocessing (default: %(default)s)",
    )
    film.add_argument(
        "--adapter",
        metavar="POLICY",
        help="With --view=saw: load the adapter of the run and show what its model_inputs returns",
    )
    film.add_argument(
        "--profile",
        metavar="NAME|PATH",
        help="With --view=saw: the profile of the run's server, if it is none of this package's",
    )
    film.add_argument("--overwrite", action="store_true", help="Replace films that are there already")
    film.add_argument(
        "--cases",
        dest="case_set",
        metavar="TRACK|MANIFEST",
        help="Where the cases are, if not where the run says",
    )
    add_libero(film)
    film.set_defaults(run=_film)


def _film(options: argparse.Namespace) -> int:
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in a run: the last bits depend on it
    from pytest_libero_max.films.recorded import chosen, film_path, open_recorded
    from pytest_libero_max.films.saw import shown_by

    for name, least in (("size", 32), ("every", 1)):
        if getattr(options, name) < least:
            raise OptionError(f"--{name}={getattr(options, name)}, but must be at least {least}.")
    if options.view != "saw" and (options.adapter or options.profile):
        raise OptionError("--adapter and --profile say what the policy saw: give --view=saw as well.")
    refused = 0
    where = options.run_folder, options.case_set, options.libero, options.libero_assets
    with open_recorded(*where) as run, Work() as work:
        records = chosen(run.stored, options.cases, options.select)
        policy = run.stored.run.provenance["policy"]
        shown = shown_by(policy, options.adapter, options.profile) if options.view == "saw" else None
        folder = options.output or run.folder / "films"
        for number, record in enumerate(records, start=1):
            path, place = film_path(folder, record, options.format, options.view), f"{number}/{len(records)}"
            begin = time.perf_counter()
            if path.exists() and not options.overwrite:
                work.say(f"{place} {path} is there already; --overwrite makes it again")
                continue
            told = partial(_tell, work, number - 1, len(records), record)
            try:
                run.film(record, path, options.size, options.every, options.overwrite, told, shown)
            except LiberoMaxError as error:
                refused += 1
                work.say(f"{place} no film: {error}")
            else:
                seconds, kilobytes = time.perf_counter() - begin, path.stat().st_size / 1000
                work.say(f"{place} {path} ({kilobytes:.0f} kB, {seconds:.1f} s)")
    if options.output is None and options.view == "world" and refused < len(records):
        print(f"libero-max report {options.run_folder} links the films in report.html.")
    if not records:
        print(f"No pair of this run is selected by --select={options.select}.")
    return 1 if refused else 0


def _tell(work: Work, before: int, films: int, record: PairRecord, step: int) -> None:
    """Show how far the filming is.

    Args:
        work: Where.
        before: Films that are finished.
        films: All films.
        record: The pair that is being filmed.
        step: Policy steps of it that are drawn.
    """
    steps = max(arm.steps or 0 for arm in record.arms.values())
    left = work.left(before + step / max(steps, 1), films)
    work.show(f"film {before + 1} of {films}, step {step} of {steps}{left}: {record.item_id}")
