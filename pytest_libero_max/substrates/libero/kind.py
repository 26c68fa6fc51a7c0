"""How the genuine substrate is opened and described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.contract import Catalogue, Substrate, SubstrateKind, SubstrateOptions

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.libero.installation import Installation


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
    from pytest_libero_max.substrates.registry import own_variation

    own = own_variation if options.variations == "own" else None
    return LiberoSubstrate(_installations(options), options.semantics, options.instruction, own)


def _describe(options: SubstrateOptions) -> dict[str, Any]:
    return {
        "installations": [str(found) for found in _installations(options)],
        "roots": [str(root) for root in options.installations],
        "assets": None if options.assets is None else str(options.assets),
        "semantics": options.semantics,
        "instruction_source": options.instruction,
        "source_variations": options.variations,
    }


def _installations(options: SubstrateOptions) -> tuple[Installation, ...]:
    from pytest_libero_max.substrates.libero.installation import find_installations

    return find_installations(options.installations, assets=options.assets)


def _catalogue(options: SubstrateOptions) -> Catalogue:
    from pytest_libero_max.substrates.libero.catalogue import InstalledCatalogue

    if options.variations == "own":
        raise SubstrateError(
            "Source variations 'own' are chosen on the substrate that they were made for. Leave out "
            "--substrate, or choose from the variations that are installed."
        )
    return InstalledCatalogue(_installations(options), options.classification)


def _lacking(options: SubstrateOptions, cases: Sequence[Case]) -> Mapping[str, str]:
    from pytest_libero_max.substrates.libero.lacking import lacking

    if options.variations == "own":
        return {}
    return lacking(_installations(options), cases)


KIND = SubstrateKind("libero", _open, _describe, _lacking, _catalogue)
