"""Entry of the embedded substrate in the registry."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import Catalogue, Substrate, SubstrateKind, SubstrateOptions
from pytest_libero_max.tasks.suites import LIBERO_SUITES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.variation import Variation


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate

    return EmbeddedSubstrate(images=options.images)


def _catalogue(options: SubstrateOptions) -> Catalogue:
    from pytest_libero_max.substrates.embedded.catalogue.lookup import EmbeddedCatalogue

    return EmbeddedCatalogue()


def _variation_of(case: Case) -> Variation:
    from pytest_libero_max.substrates.embedded.catalogue.lookup import variation_of

    return variation_of(case)


def _lacking(options: SubstrateOptions, cases: Sequence[Case]) -> Mapping[str, str]:
    """Name the cases of LIBERO-Plus, if not one of them names a variation of the embedded scenes."""
    plus = [case for case in cases if case.source == "plus"]
    for case in plus:
        try:
            _variation_of(case)
        except SubstrateError:
            continue
        return {}
    why = "they name tasks of the genuine LIBERO-Plus, which --libero-max-substrate=libero plays"
    return {case.case_id: why for case in plus}


def _scene_of(options: SubstrateOptions, case: Case) -> tuple[Any, ...]:
    if case.unmodified:
        return case.suite, case.task_index, ""
    variation = _variation_of(case)
    return case.suite, variation.base_index, json.dumps(variation.scene, sort_keys=True)


def _draw(path: Path, substrate: Any) -> None:
    from pytest_libero_max.substrates.embedded import scene_sheets

    if path.stem == "scenes":
        scene_sheets.write_scenes(path)
    elif path.stem == "plus":
        scene_sheets.write_plus(path, substrate)
    else:
        scene_sheets.write_pro(path, substrate)


KIND = SubstrateKind(
    "embedded",
    _open,
    lambda options: {"images": options.images},
    suites=LIBERO_SUITES,
    lacking=_lacking,
    catalogue=_catalogue,
    variation_of=_variation_of,
    plays_frozen=True,
    reads=frozenset({"images"}),
    note=(
        "Measured on the embedded substrate: it shares tasks, protocol and events with the genuine one, not "
        "its images. Its scores are not comparable with published ones."
    ),
    scene_of=_scene_of,
    sheets=dict.fromkeys(("scenes.png", "plus.png", "pro.png"), _draw),
)
