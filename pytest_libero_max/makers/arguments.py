"""Arguments and output that several commands of the makers share."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_libero_max.cli.arguments import add_jobs, option, substrate_options
from pytest_libero_max.cli.work import Work

if TYPE_CHECKING:
    from pytest_libero_max.makers.construction.examiner import Examiner, Progress
    from pytest_libero_max.substrates.contract import Catalogue


def add_classification(command: argparse.ArgumentParser) -> None:
    """Add the option for the classification of LIBERO-Plus."""
    option(
        command,
        "--plus-classification FILE",
        "On the libero substrate: task_classification.json of LIBERO-Plus's repository, which its "
        "package lacks (default: that of the checkout)",
        type=Path,
    )


def add_expert(command: argparse.ArgumentParser, *, default: str | None) -> None:
    """Add the option for the policy that plays the cases that pass."""
    option(
        command,
        "--expert POLICY",
        "Privileged policy that solves the tasks, as for pytest --libero-max-policy: it plays each case "
        "that passes, and one that it completes is certified. It decides nothing else (default: "
        + (default or "none; then nothing is certified")
        + ")",
        default=default,
    )


def add_examination(command: argparse.ArgumentParser) -> None:
    """Add the options for the number of processes that examine cases, and for the folder of their results."""
    add_jobs(command)
    option(
        command,
        "--work FOLDER",
        "Keeps examinations between interruptions",
        type=Path,
        default=Path(".libero-max"),
    )


@contextmanager
def examining(options: argparse.Namespace) -> Iterator[tuple[Work, Examiner]]:
    """Yield an examiner on the substrate that is asked for, and the display of its progress."""
    from pytest_libero_max.makers.construction.examiner import Examiner

    with Work() as work:

        def tell(progress: Progress) -> None:
            work.show(str(progress), last=progress.ended)

        where = options.substrate.name, substrate_options(options)
        with Examiner(options.work, options.jobs, tell, *where) as examiner:
            yield work, examiner


def catalogue_of(options: argparse.Namespace) -> Catalogue:
    """Return the catalogue of source variations of the substrate that is asked for."""
    from pytest_libero_max.substrates.registry import SUBSTRATES

    return SUBSTRATES[options.substrate.name].catalogue(substrate_options(options))
