"""Which substrate a name stands for; each is imported only when it is asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, cast

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.registry import Registry, modules_in

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.worlds.contract import SourceVariation, Substrate
    from pytest_libero_max.worlds.libero.installation import Installation

SEMANTICS = ("published", "corrected")
"""``published`` keeps the defects of the authors' event code, since published numbers contain them."""

INSTRUCTIONS = ("published", "clean")
"""``published`` prompts of LIBERO-Plus have the name of the variation in them; ``clean`` ones do not."""

SOURCE_VARIATIONS = ("installed", "own")
"""``installed``: LIBERO-Plus's and LIBERO-PRO's own, from their installations; ``own``: in their place this
package's, which are changes at reset."""


@dataclass(frozen=True)
class SubstrateOptions:
    """What the genuine substrate can be told. The others take none of it.

    Attributes:
        installations: Folders of LIBERO, LIBERO-Plus or LIBERO-PRO; none: what ``import libero`` finds.
        assets: Models and textures for those that have none of their own.
        semantics: One of :data:`SEMANTICS`.
        instruction: One of :data:`INSTRUCTIONS`.
        variations: One of :data:`SOURCE_VARIATIONS`.
    """

    installations: tuple[Path, ...] = ()
    assets: Path | None = None
    semantics: Literal["published", "corrected"] = "published"
    instruction: Literal["published", "clean"] = "published"
    variations: Literal["installed", "own"] = "installed"


class SubstrateOpener(Protocol):
    """Opens a substrate; each substrate of this package is a module with one called ``open_substrate``."""

    def __call__(
        self, options: SubstrateOptions, variation_of: Callable[[Case], SourceVariation] | None
    ) -> Substrate:
        """The substrate, which builds nothing before it is asked for a world.

        Args:
            options: What the genuine substrate is told; others may ignore it.
            variation_of: Finds this package's own source variation that a case plays, or None.
        """
        ...


def _accept(name: str, found: object) -> SubstrateOpener:
    if not callable(found):
        raise ValueError(
            f"{found!r} cannot be called: an entry is a function (options, variation_of) -> Substrate"
        )
    return cast(SubstrateOpener, found)


def _own() -> Mapping[str, Callable[[], SubstrateOpener]]:
    """The substrates of this package: the folders of ``worlds`` with a module ``substrate``, and tiny."""
    worlds = "pytest_libero_max.worlds"
    folders = [name for name in modules_in(worlds) if "substrate" in modules_in(f"{worlds}.{name}")]
    modules = {name: f"{worlds}.{name}.substrate" for name in folders} | {"tiny": f"{worlds}.tiny"}
    return {name: partial(_opener, name, module) for name, module in modules.items()}


def _opener(name: str, module: str) -> SubstrateOpener:
    return _accept(name, importlib.import_module(module).open_substrate)


SUBSTRATES: Registry[SubstrateOpener] = Registry(
    "substrate", "pytest_libero_max.substrates", _own, _accept, SubstrateError
)
"""Every substrate by name: this package's, then those that installed packages add."""


def open_substrate(
    name: str,
    options: SubstrateOptions | None = None,
    variation_of: Callable[[Case], SourceVariation] | None = None,
) -> Substrate:
    """The substrate called ``name``.

    Args:
        name: One of :data:`SUBSTRATES`.
        options: For the genuine one.
        variation_of: Finds the package's own source variation that a case plays. The embedded substrate needs
            it for other than unmodified tasks, the genuine one for variations of the package's own.

    Raises:
        SubstrateError: There is none of that name, or it cannot be imported.
    """
    return SUBSTRATES[name](options or SubstrateOptions(), variation_of)


def describe_substrate(name: str, options: SubstrateOptions | None = None) -> dict[str, Any]:
    """Name and origin of a substrate, as JSON values, without building or importing anything of it.

    Raises:
        SubstrateError: A genuine installation is missing or incomplete.
    """
    if name != "libero":
        return {"name": name}
    options = options or SubstrateOptions()
    installations = [str(found) for found in installations_of(options)]
    return {
        "name": name,
        "installations": installations,
        "semantics": options.semantics,
        "instruction_source": options.instruction,
        "source_variations": options.variations,
    }


def installations_of(options: SubstrateOptions) -> tuple[Installation, ...]:
    """The genuine installations that the options name, or the one that ``import libero`` finds.

    Raises:
        SubstrateError: One is missing or incomplete.
    """
    from pytest_libero_max.worlds.libero.installation import find_installation

    return tuple(find_installation(root, assets=options.assets) for root in options.installations or (None,))
