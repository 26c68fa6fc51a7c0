"""The entry of a substrate in the registry, and the options that substrates take."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.worlds.contract import SourceVariation, Substrate

FindVariation: TypeAlias = "Callable[[Case], SourceVariation]"
"""Finds the package's own source variation that a case of LIBERO-Plus or LIBERO-PRO plays."""


@dataclass(frozen=True)
class SubstrateOptions:
    """What a substrate can be told. The genuine one reads all of it, the package's others none.

    Attributes:
        installations: Folders of LIBERO, LIBERO-Plus or LIBERO-PRO; none: what ``import libero`` finds.
        assets: Models and textures for those that have none of their own.
        semantics: One of :data:`.registry.SEMANTICS`.
        instruction: One of :data:`.registry.INSTRUCTIONS`.
        variations: One of :data:`.registry.SOURCE_VARIATIONS`.
    """

    installations: tuple[Path, ...] = ()
    assets: Path | None = None
    semantics: Literal["published", "corrected"] = "published"
    instruction: Literal["published", "clean"] = "published"
    variations: Literal["installed", "own"] = "installed"


def _nothing(options: SubstrateOptions) -> dict[str, Any]:
    return {}


def _nothing_lacking(
    options: SubstrateOptions, cases: Sequence[Case], variation_of: FindVariation
) -> Mapping[str, str]:
    return {}


@dataclass(frozen=True)
class SubstrateKind:
    """A substrate as a registry holds it: importing it imports no simulator.

    Attributes:
        name: The name under which it is asked for.
        open: Opens it. What it imports, it imports when it is called. The second argument finds the source
            variation that a case plays.
        describe: Returns, without building anything, what tells one opening of it from another, as JSON
            values: a report holds them.
        lacking: Returns why cases of a case set cannot play, by case id, the same words for all that lack the
            same; told without building anything. A case that it does not name may still turn out not to play.
    """

    name: str
    open: Callable[[SubstrateOptions, FindVariation], Substrate]
    describe: Callable[[SubstrateOptions], dict[str, Any]] = _nothing
    lacking: Callable[[SubstrateOptions, Sequence[Case], FindVariation], Mapping[str, str]] = _nothing_lacking
