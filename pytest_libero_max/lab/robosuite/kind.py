"""Entry of the substrate of robosuite's tasks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.lab.robosuite.robots import BENCHMARK, ROBOTS
from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.lab.robosuite.substrate import RobosuiteSubstrate

    return RobosuiteSubstrate()


def _examples(options: SubstrateOptions) -> Sequence[Case]:
    from pytest_libero_max.lab.robosuite.examples import examples

    return examples()


KIND = SubstrateKind(
    BENCHMARK,
    _open,
    suites=tuple(ROBOTS),
    examples=_examples,
    note=(
        "Measured on robosuite's own tasks, under their own checks of success; initial states are drawn "
        "anew, so that scores are of other episodes than published ones."
    ),
)
