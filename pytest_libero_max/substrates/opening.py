"""Opening a substrate by name, with the catalogues of source variations that it plays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pytest_libero_max.substrates.lookup import variation_of
from pytest_libero_max.substrates.registry import SUBSTRATES

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.substrates.kind import SubstrateOptions
    from pytest_libero_max.worlds.contract import Substrate


def open_substrate(name: str, options: SubstrateOptions | None = None) -> Substrate:
    """Open the substrate called ``name``.

    Args:
        name: One of :data:`pytest_libero_max.substrates.registry.SUBSTRATES`.
        options: What the substrate is told; by default what it does by itself.

    Raises:
        SubstrateError: There is none of that name, or it cannot be opened.
    """
    from pytest_libero_max.substrates.kind import SubstrateOptions

    return SUBSTRATES[name].open(options or SubstrateOptions(), variation_of)


def lacking(name: str, cases: Sequence[Case], options: SubstrateOptions | None = None) -> Mapping[str, str]:
    """Why cases cannot play on a substrate, by case id, told without building anything; others may play.

    Raises:
        SubstrateError: There is no substrate of that name, or a genuine installation is missing.
    """
    from pytest_libero_max.substrates.kind import SubstrateOptions

    return SUBSTRATES[name].lacking(options or SubstrateOptions(), cases, variation_of)
