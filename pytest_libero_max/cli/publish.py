"""``libero-max publish`` and ``published``: packed results of a run, and those of the paper."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_command(commands: Commands) -> None:
    """Add ``publish`` and ``published`` to the parser."""
    publish = commands.add_parser(
        "publish", help="Write packed pairs, report and figures of a run into a folder to be published"
    )
    publish.add_argument("run_folder", type=Path, metavar="RUN", help="The output folder of the run")
    publish.add_argument("folder", type=Path, metavar="FOLDER", help="For example reports/lite/expert")
    publish.set_defaults(run=_publish)

    published = commands.add_parser("published", help="Print the results published in the paper")
    published.set_defaults(run=_published)


def _publish(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.publication import publish

    print(f"Written: {', '.join(map(str, publish(options.run_folder, options.folder)))}")


def _published(options: argparse.Namespace) -> None:
    from pytest_libero_max.report.published import published_lines

    print("\n".join(published_lines()))
