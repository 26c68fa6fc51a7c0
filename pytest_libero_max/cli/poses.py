"""``libero-max poses``: recorded pairs in three dimensions, for the page of their run."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.film import add_choice, write_each

if TYPE_CHECKING:
    from collections.abc import Callable

    from pytest_libero_max.benchmark.documents import Json


def add_command(commands: Commands) -> None:
    """Add ``poses`` to the parser."""
    poses = commands.add_parser(
        "poses",
        help="Write pairs of a run in three dimensions, for its page",
        description="The poses of everything after each step, with the shapes of the scene, which "
        "libero-max report puts into report.html. The run must have kept traces (--libero-max-traces or "
        "--libero-max-film, which writes poses as well). Scenes that are not this package's own are "
        "refused. Exit status 1 if a pair was refused.",
    )
    add_choice(poses, "poses")
    poses.set_defaults(run=_poses, size=32, every=1)


def _poses(options: argparse.Namespace) -> int:
    from pytest_libero_max.runs.media import POSES_NAME, poses_name

    return write_each(
        options,
        POSES_NAME,
        lambda folder, record: folder / poses_name(record.item_id),
        _writer,
        f"libero-max report {options.run_folder} shows them in report.html.",
    )


def _writer(provenance: Json) -> Callable[..., None]:
    from pytest_libero_max.errors import ReportError
    from pytest_libero_max.films.recorded import pose_pair
    from pytest_libero_max.substrates.registry import SUBSTRATES

    substrate = provenance["substrate"]["name"]
    if substrate not in SUBSTRATES or not SUBSTRATES[substrate].portable:
        raise ReportError(
            f"The run was played on substrate {substrate!r}, whose models are not this package's own, so no "
            "page may hold them. libero-max lab rerun writes every pose of it for the viewer of Rerun."
        )

    def write(*pair: Any, size: int, every: int, **how: Any) -> None:
        pose_pair(*pair, **how)

    return write
