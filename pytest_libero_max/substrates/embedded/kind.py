"""How the embedded substrate is opened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.kind import FindVariation, SubstrateKind, SubstrateOptions

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.worlds.contract import Substrate


def _open(options: SubstrateOptions, variation_of: FindVariation) -> Substrate:
    from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate

    return EmbeddedSubstrate(variation_of)


def _lacking(
    options: SubstrateOptions, cases: Sequence[Case], variation_of: FindVariation
) -> Mapping[str, str]:
    """The cases of LIBERO-Plus, if not one of them names a variation of the embedded scenes."""
    plus = [case for case in cases if case.source == "plus"]
    for case in plus:
        try:
            variation_of(case)
        except SubstrateError:
            continue
        return {}
    why = "they name tasks of the genuine LIBERO-Plus, which --libero-max-substrate=libero plays"
    return {case.case_id: why for case in plus}


KIND = SubstrateKind("embedded", _open, lacking=_lacking)
