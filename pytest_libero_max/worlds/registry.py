"""Which substrate a name stands for; each is imported only when it is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.errors import SubstrateError, did_you_mean

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import Substrate

SUBSTRATES = ("embedded", "tiny")


def open_substrate(name: str) -> Substrate:
    """The substrate called ``name``.

    Raises:
        SubstrateError: There is none of that name, or it cannot be imported.
    """
    if name == "embedded":
        from pytest_libero_max.worlds.embedded.substrate import EmbeddedSubstrate

        return EmbeddedSubstrate()
    if name == "tiny":
        from pytest_libero_max.worlds.tiny import TinySubstrate

        return TinySubstrate()
    raise SubstrateError(f"substrate={name!r} is not known. {did_you_mean(name, SUBSTRATES)}")
