"""The command that films recorded pairs: film."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.substrates import add_libero
from pytest_libero_max.errors import LiberoMaxError, OptionError
from pytest_libero_max.report.media import FILM_FORMATS, FILM_SELECTIONS

if TYPE_CHECKING:
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

    for name, least in (("size", 32), ("every", 1)):
        if getattr(options, name) < least:
            raise OptionError(f"--{name}={getattr(options, name)}, but must be at least {least}.")
    refused = 0
    with open_recorded(options.run_folder, options.case_set, options.libero, options.libero_assets) as run:
        records = chosen(run.stored, options.cases, options.select)
        folder = options.output or run.folder / "films"
        for number, record in enumerate(records, start=1):
            path = film_path(folder, record, options.format)
            begin = time.perf_counter()
            if path.exists() and not options.overwrite:
                print(f"{number}/{len(records)} {path} is there already; --overwrite makes it again")
                continue
            try:
                run.film(record, path, options.size, options.every, options.overwrite)
            except LiberoMaxError as error:
                refused += 1
                print(f"{number}/{len(records)} no film: {error}", flush=True)
            else:
                seconds, kilobytes = time.perf_counter() - begin, path.stat().st_size / 1000
                print(f"{number}/{len(records)} {path} ({kilobytes:.0f} kB, {seconds:.1f} s)", flush=True)
    if options.output is None and refused < len(records):
        print(f"libero-max report {options.run_folder} links the films in report.html.")
    if not records:
        print(f"No pair of this run is selected by --select={options.select}.")
    return 1 if refused else 0
