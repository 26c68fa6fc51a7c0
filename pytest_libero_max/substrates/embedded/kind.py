"""How the embedded substrate is opened, and what it plays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import Catalogue, Substrate, SubstrateKind, SubstrateOptions

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.variation import Variation


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate

    return EmbeddedSubstrate()


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


KIND = SubstrateKind("embedded", _open, lacking=_lacking, catalogue=_catalogue, variation_of=_variation_of)
