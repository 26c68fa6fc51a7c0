"""Entry of Meta-World in the registry of substrates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pytest_libero_max.lab.metaworld.robot import MT50, lacking_packages
from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions, Tracks

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.tasks.contents import TaskMetadata


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.lab.metaworld.substrate import MetaworldSubstrate

    return MetaworldSubstrate()


def _lacking(options: SubstrateOptions, cases: Sequence[Case]) -> Mapping[str, str]:
    missing = lacking_packages()
    return {case.case_id: missing for case in cases} if missing else {}


def _contents(suite: str, index: int) -> TaskMetadata:
    from pytest_libero_max.lab.metaworld.tasks import contents

    return contents(suite, index)


def _scene_of(options: SubstrateOptions, case: Case) -> tuple[Any, ...]:
    return case.suite, case.task_index, *(change.get("object", "") for change in case.event.setup)


KIND = SubstrateKind(
    "metaworld",
    _open,
    suites=(MT50.name,),
    lacking=_lacking,
    contents=_contents,
    tracks=lambda options: Tracks("metaworld", pictured="smoke", per_event={"smoke": 3, "mt50": 64}),
    control_hz=80,
    note="Measured on Meta-World's tasks under the protocol of LIBERO-MAX.",
    scene_of=_scene_of,
)
