"""The contract of a substrate: what it plays, what it says of itself, and what it can be told.

A substrate is a folder of this package, or another package's entry point, with a :class:`SubstrateKind`.
Nothing outside asks for a substrate by its name: what makes a difference elsewhere is a field of the kind.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

from pytest_libero_max.errors import SubstrateError

if TYPE_CHECKING:
    from pytest_libero_max.benchmark.cases import Case
    from pytest_libero_max.benchmark.documents import Json
    from pytest_libero_max.substrates.variation import Variation
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import World


class Substrate(Protocol):
    """Builds worlds and keeps them for reuse."""

    @property
    def name(self) -> str:
        """Name of the substrate, as records have it."""
        ...

    def world(self, case: Case) -> World:
        """Return the world that plays a case: built on first use, shared by every case of the same scene.

        Raises:
            SubstrateError: The substrate cannot build this case; the message says what it lacks.
        """
        ...

    def fingerprint(self) -> Mapping[str, str]:
        """Return what could change a result: package versions, a digest of the assets, the GL backend."""
        ...

    def close(self) -> None:
        """Close every world."""
        ...


class Catalogue(Hashable, Protocol):
    """The source variations that a substrate plays, and what their scenes contain."""

    def variations(self, source: str) -> tuple[Variation, ...]:
        """Every variation of ``plus`` or ``pro``, in order.

        Raises:
            ManifestError: Another source.
        """
        ...

    def metadata(self, variation: Variation) -> TaskMetadata:
        """Contents of the scene of a variation."""
        ...

    def variant(self, variation: Variation) -> Json | None:
        """Entry of a variation in a manifest's ``substrate_variant``, if it has one."""
        ...

    def lacks(self, variation: Variation) -> str:
        """Say what the scene of a variation needs that is not on this machine; empty for nothing."""
        ...


@dataclass(frozen=True)
class SubstrateOptions:
    """The options that substrates take; :attr:`SubstrateKind.reads` has those that one of them reads.

    Attributes:
        installations: Folders of LIBERO, LIBERO-Plus or LIBERO-PRO; none: what ``import libero`` finds.
        assets: Models and textures for those that have none of their own.
        semantics: One of :data:`.registry.SEMANTICS`.
        instruction: One of :data:`.registry.INSTRUCTIONS`.
        variations: One of :data:`.registry.SOURCE_VARIATIONS`.
        classification: LIBERO-Plus's ``task_classification.json``, for catalogues; None for that of its
            checkout.
    """

    installations: tuple[Path, ...] = ()
    assets: Path | None = None
    semantics: Literal["published", "corrected"] = "published"
    instruction: Literal["published", "clean"] = "published"
    variations: Literal["installed", "own"] = "installed"
    classification: Path | None = None


def _nothing(options: SubstrateOptions) -> dict[str, Any]:
    return {}


def _nothing_lacking(options: SubstrateOptions, cases: Sequence[Case]) -> Mapping[str, str]:
    return {}


def _no_catalogue(options: SubstrateOptions) -> Catalogue:
    raise SubstrateError("This substrate has no catalogue of source variations: it cannot be built from.")


def _no_variation(case: Case) -> Variation:
    raise SubstrateError(f"case {case.case_id!r}: this substrate has no source variations of its own.")


@dataclass(frozen=True)
class SubstrateKind:
    """A substrate as a registry holds it: importing it imports no simulator.

    Attributes:
        name: The name under which it is asked for.
        open: Opens it. What it imports, it imports when it is called.
        describe: Returns, without building anything, what tells one opening of it from another, as JSON
            values: a report holds them.
        lacking: Returns why cases of a case set cannot play, by case id, the same words for all that lack the
            same; told without building anything. A case that it does not name may still turn out not to play.
        catalogue: Opens the catalogue of its source variations, from which cases can be chosen.
        variation_of: Finds the source variation of its own that a case plays, without building anything.
            Raises :class:`.SubstrateError` where it has none.
    """

    name: str
    open: Callable[[SubstrateOptions], Substrate]
    describe: Callable[[SubstrateOptions], dict[str, Any]] = _nothing
    lacking: Callable[[SubstrateOptions, Sequence[Case]], Mapping[str, str]] = _nothing_lacking
    catalogue: Callable[[SubstrateOptions], Catalogue] = _no_catalogue
    variation_of: Callable[[Case], Variation] = _no_variation
