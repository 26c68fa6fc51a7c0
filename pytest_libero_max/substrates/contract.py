"""Contract of a substrate: its worlds, its description, and its options.

A substrate is a folder of this package, or another package's entry point, with a :class:`SubstrateKind`.
Other code never compares the names of substrates: each difference that matters there is a field of the kind.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol

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

    def world(self, case: Case) -> World:
        """Return the world that plays a case: built on first use, shared by every case of the same scene.

        Raises:
            SubstrateError: The substrate cannot build this case; the message names the missing requirement.
        """

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        """Return what could change a result in every scene: package versions, installation, GL backend.

        The content of a single scene is in :meth:`~pytest_libero_max.worlds.contract.World.scene_fields`.

        Args:
            images: True to name as well what draws images, for which a GL context may have to be opened.
        """

    def close(self) -> None:
        """Close every world."""


class Catalogue(Hashable, Protocol):
    """The source variations that a substrate plays, and what their scenes contain."""

    def variations(self, source: str) -> tuple[Variation, ...]:
        """Every variation of ``plus`` or ``pro``, in order.

        Raises:
            ManifestError: Another source.
        """

    def metadata(self, variation: Variation) -> TaskMetadata:
        """Contents of the scene of a variation."""

    def variant(self, variation: Variation) -> Json | None:
        """Entry of a variation in a manifest's ``substrate_variant``, if it has one."""

    def lacks(self, variation: Variation, *, models: bool = True) -> str:
        """Return the requirements of a variation's scene that this machine lacks, in words; empty for none.

        Args:
            models: False to count models that not every installation has as missing, even if they are here.
        """


@dataclass(frozen=True)
class SubstrateOptions:
    """The options that substrates take; :attr:`SubstrateKind.reads` has those that one of them reads."""

    installations: tuple[Path, ...] = ()
    """Folders of LIBERO, LIBERO-Plus or LIBERO-PRO; none: what ``import libero`` finds."""
    assets: Path | None = None
    """Models and textures for those that have none of their own."""
    semantics: Literal["published", "corrected"] = "published"
    """``published`` keeps the defects of the authors' event code, since published numbers contain them."""
    instruction: Literal["published", "clean"] = "published"
    """``published`` prompts of LIBERO-Plus have the name of the variation in them; ``clean`` ones do not."""
    variations: Literal["installed", "own"] = "installed"
    """``installed``: LIBERO-Plus's and LIBERO-PRO's own, from their installations; ``own``: in their place
    this package's, which are changes at reset."""
    images: Literal["2", "1"] = "2"
    """Version of the embedded images. ``1`` has four samples per pixel, as LIBERO's have, and takes twice as
    long in software; ``2`` has one."""
    classification: Path | None = None
    """LIBERO-Plus's ``task_classification.json``, for catalogues; None for that of its checkout."""

    CHOICES: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "semantics": ("published", "corrected"),
        "instruction": ("published", "clean"),
        "variations": ("installed", "own"),
        "images": ("2", "1"),
    }
    """Values of the options that the text of a substrate names, see :class:`ChosenSubstrate`."""
    DESCRIBED: ClassVar[Mapping[str, str]] = {
        "semantics": "semantics",
        "instruction": "instruction_source",
        "variations": "source_variations",
        "images": "images",
    }
    """Their names in the description of a substrate (:attr:`SubstrateKind.describe`)."""
    UNDESCRIBED: ClassVar[Mapping[str, str]] = {"images": "1"}
    """Values where a description has none: those of runs from before the option."""

    def for_people(self) -> SubstrateOptions:
        """Return the options with the images that look best, for films and galleries."""
        return replace(self, images="1")


@dataclass(frozen=True)
class ChosenSubstrate:
    """A substrate with the options that its text names, for example ``libero:semantics=corrected``."""

    name: str
    options: SubstrateOptions = SubstrateOptions()

    def __str__(self) -> str:
        usual = SubstrateOptions()
        chosen = {option: getattr(self.options, option) for option in SubstrateOptions.CHOICES}
        words = [f"{option}={value}" for option, value in chosen.items() if value != getattr(usual, option)]
        return f"{self.name}:{','.join(words)}" if words else self.name


@dataclass(frozen=True)
class Tracks:
    """The frozen tracks that a substrate plays."""

    folder: str = ""
    """Folder of its own versions of tracks, below that of all tracks; empty for none."""
    defaults: tuple[str, ...] = ("smoke",)
    """Tracks to play where none is named: the first one of which every case plays, else the last."""
    pictured: str = "original"
    """Track of which a gallery shows the events."""
    per_event: Mapping[str, int] = field(default_factory=dict)
    """Tracks that construction draws from the unmodified tasks of its suites, with the number of cases of an
    event."""

    def name(self, track: str) -> str:
        """Name of the substrate's own version of a track, if there is one; otherwise the name as it is."""
        from pytest_libero_max.benchmark.tracks import name_in

        return name_in(self.folder, track)


def _no_catalogue(options: SubstrateOptions) -> Catalogue:
    raise SubstrateError("This substrate has no catalogue of source variations: it cannot be built from.")


def _libero_contents(suite: str, index: int) -> TaskMetadata:
    from pytest_libero_max.tasks.contents import task_metadata

    return task_metadata(suite, index)


def _no_variation(case: Case) -> Variation:
    raise SubstrateError(f"case {case.case_id!r}: this substrate has no source variations of its own.")


@dataclass(frozen=True)
class SubstrateKind:
    """A substrate as a registry holds it: importing it imports no simulator."""

    name: str
    open: Callable[[SubstrateOptions], Substrate]
    """Opens it. What it imports, it imports when it is called."""
    describe: Callable[[SubstrateOptions], dict[str, Any]] = lambda options: {}
    """Returns a description for the report, as JSON values, without building anything."""
    lacking: Callable[[SubstrateOptions, Sequence[Case]], Mapping[str, str]] = lambda options, cases: {}
    """Returns the reasons why cases of a case set cannot play, by case id, the same words for the same
    reason, without building anything. A case that is absent may still turn out not to play."""
    catalogue: Callable[[SubstrateOptions], Catalogue] = _no_catalogue
    """Opens the catalogue of its source variations, from which cases can be chosen."""
    variation_of: Callable[[Case], Variation] = _no_variation
    """Finds the source variation of its own that a case plays, without building anything. Raises
    :class:`.SubstrateError` where it has none."""
    contents: Callable[[str, int], TaskMetadata] = _libero_contents
    """Returns the contents of an unmodified task by suite and index, from which events are drawn, without
    building anything; by default that of LIBERO's."""
    tracks: Callable[[SubstrateOptions], Tracks] = lambda options: Tracks()
    suites: tuple[str, ...] | None = None
    """Suites whose tasks it has; None for any."""
    examples: Callable[[SubstrateOptions], Sequence[Case]] = lambda options: ()
    """Returns cases with which the rules examine it; none for those of its tracks."""
    control_hz: int = 20
    """Control steps in a second of its robots, in which times of latency are counted; LIBERO's."""
    plays_frozen: bool = False
    """True if every case of the tracks that come with this package plays, wherever that is."""
    reads: frozenset[str] = frozenset()
    """Fields of :class:`SubstrateOptions` that it reads; giving it another is refused."""
    comparable_with_published: bool | None = False
    """False if its scores are never comparable with published ones, None if the caveats of a run decide."""
    note: str | None = None
    """Sentences to print beside every score; empty for none, None to call every run of it a dry run."""
    worker_gib: float = 0.8
    """Memory of a process that plays it with images, GiB."""
    limit_gib: float = 4.0
    """Smallest memory limit of such a process, GiB of what it may ask for."""
    scene_of: Callable[[SubstrateOptions, Case], tuple[Any, ...]] = lambda options, case: (
        case.suite,
        case.source,
        case.task_index,
        case.source_category or "",
    )
    """Returns a key by which cases are sorted so that neighbours share a scene."""
    batch: int = 12
    """Cases that a process examines at a time, after which they are kept."""
    sheets: Mapping[str, Callable[[Path, Any], None]] = field(default_factory=dict)
    """Functions that draw contact sheets of its own with an open substrate, by the files' names."""

    def unplayable(self, options: SubstrateOptions, cases: Sequence[Case]) -> dict[str, str]:
        """Return the reasons why cases cannot play, by case id: another suite, or what is lacking."""
        foreign = {
            case.case_id: f"{self.name} has no suite {case.suite}, but {', '.join(self.suites)}"
            for case in cases
            if self.suites is not None and case.suite not in self.suites
        }
        own = [case for case in cases if case.case_id not in foreign]
        return {**foreign, **self.lacking(options, own)} if own else foreign
