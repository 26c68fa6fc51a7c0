"""How the tiny substrate is opened."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.substrates.kind import FindVariation, SubstrateKind, SubstrateOptions

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import Substrate


def _open(options: SubstrateOptions, variation_of: FindVariation) -> Substrate:
    from pytest_libero_max.substrates.tiny.world import TinySubstrate

    return TinySubstrate()


KIND = SubstrateKind("tiny", _open)
