"""Opening a substrate by name, with the catalogues of source variations that it plays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pytest_libero_max.sources.lookup import variation_of
from pytest_libero_max.worlds.registry import SUBSTRATES

if TYPE_CHECKING:
    from pytest_libero_max.worlds.contract import Substrate
    from pytest_libero_max.worlds.kind import SubstrateOptions


def open_substrate(name: str, options: SubstrateOptions | None = None) -> Substrate:
    """Open the substrate called ``name``.

    Args:
        name: One of :data:`pytest_libero_max.worlds.registry.SUBSTRATES`.
        options: What the substrate is told; by default what it does by itself.

    Raises:
        SubstrateError: There is none of that name, or it cannot be opened.
    """
    from pytest_libero_max.worlds.kind import SubstrateOptions

    return SUBSTRATES[name].open(options or SubstrateOptions(), variation_of)
