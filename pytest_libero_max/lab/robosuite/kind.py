"""Entry of the substrate of robosuite's tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.lab.robosuite.robots import BENCHMARK, ROBOTS
from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions, Tracks

if TYPE_CHECKING:
    from pytest_libero_max.tasks.contents import TaskMetadata


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.lab.robosuite.substrate import RobosuiteSubstrate

    return RobosuiteSubstrate()


def _contents(suite: str, index: int) -> TaskMetadata:
    from pytest_libero_max.lab.robosuite.tasks import task_of

    return task_of(index).metadata


KIND = SubstrateKind(
    BENCHMARK,
    _open,
    suites=tuple(ROBOTS),
    contents=_contents,
    tracks=lambda options: Tracks(BENCHMARK, pictured="smoke", per_event={"smoke": 3}),
    note=(
        "Measured on robosuite's own tasks, under their own checks of success; initial states are drawn "
        "anew, so that scores are of other episodes than published ones."
    ),
)
