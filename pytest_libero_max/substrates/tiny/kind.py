"""Entry of the tiny substrate."""

from __future__ import annotations

from pytest_libero_max.substrates.contract import Substrate, SubstrateKind, SubstrateOptions


def _open(options: SubstrateOptions) -> Substrate:
    from pytest_libero_max.substrates.tiny.world import TinySubstrate

    return TinySubstrate()


KIND = SubstrateKind("tiny", _open)
