"""Which substrate a name stands for; each is imported only when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pytest_libero_max.errors import SubstrateError, did_you_mean

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.worlds.contract import SourceVariation, Substrate
    from pytest_libero_max.worlds.libero.installation import Installation

SUBSTRATES = ("embedded", "libero", "tiny")

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
    if name == "embedded":
        from pytest_libero_max.worlds.embedded.substrate import EmbeddedSubstrate

        return EmbeddedSubstrate(variation_of)
    if name == "libero":
        from pytest_libero_max.worlds.libero.substrate import LiberoSubstrate

        options = options or SubstrateOptions()
        if options.variations == "installed":
            variation_of = None
        elif variation_of is None:
            raise SubstrateError(
                "variations='own', but no catalogue of them was given. Open the substrate with one, as "
                "pytest_libero_max.sources.open_substrate does."
            )
        return LiberoSubstrate(_installations(options), options.semantics, options.instruction, variation_of)
    if name == "tiny":
        from pytest_libero_max.worlds.tiny import TinySubstrate

        return TinySubstrate()
    raise SubstrateError(f"substrate={name!r} is not known. {did_you_mean(name, SUBSTRATES)}")


def describe_substrate(name: str, options: SubstrateOptions | None = None) -> dict[str, Any]:
    """Name and origin of a substrate, as JSON values, without building or importing anything of it.

    Raises:
        SubstrateError: A genuine installation is missing or incomplete.
    """
    if name != "libero":
        return {"name": name}
    options = options or SubstrateOptions()
    installations = [str(found) for found in _installations(options)]
    return {
        "name": name,
        "installations": installations,
        "semantics": options.semantics,
        "instruction_source": options.instruction,
        "source_variations": options.variations,
    }


def _installations(options: SubstrateOptions) -> tuple[Installation, ...]:
    from pytest_libero_max.worlds.libero.installation import find_installation

    return tuple(find_installation(root, assets=options.assets) for root in options.installations or (None,))
