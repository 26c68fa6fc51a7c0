"""The catalogues of the installed LIBERO-Plus and LIBERO-PRO: their tasks, and what each scene contains."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ManifestError, SubstrateError, counted
from pytest_libero_max.substrates.libero.installation import Flavour, Installation
from pytest_libero_max.substrates.libero.lacking import PlusNeeds, first_of, plus_category, pro_lacks
from pytest_libero_max.substrates.libero.plus import base_name, description_file
from pytest_libero_max.substrates.libero.pro_tasks import places, with_occluder
from pytest_libero_max.substrates.libero.tasks import sentence, task_names, task_of, text_of, words_of
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata, owner
from pytest_libero_max.tasks.libero_tasks import SUITES
from pytest_libero_max.tasks.sources import PRO_CATEGORIES

CLASSIFICATION = Path("benchmark", "task_classification.json")
"""File of a checkout of LIBERO-Plus with categories and difficulties of its tasks; its package lacks it."""

_TASKS = 10


Words = tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """A task description. All names are in lower case, as the environments read them."""

    objects: Mapping[str, str]
    """Category of each movable instance."""
    fixtures: Mapping[str, str]
    """Category of each other instance; tables and floors are among them."""
    interest: tuple[str, ...]
    """Names that the file marks as of interest; may be regions."""
    initial: tuple[Words, ...]
    """Facts at the start, a predicate and its arguments each, in order."""
    goal: tuple[Words, ...]
    """Facts that must hold at the end, likewise."""


class InstalledCatalogue:
    """The tasks of the installed LIBERO-Plus and LIBERO-PRO.

    Args:
        installations: One of each.
        classification: LIBERO-Plus's ``task_classification.json``; by default that of its checkout.

    Raises:
        SubstrateError: LIBERO-Plus or LIBERO-PRO is not installed.
    """

    def __init__(self, installations: Sequence[Installation], classification: Path | None = None) -> None:
        self._plus = _required(installations, "plus", "LIBERO-Plus")
        self._pro = _required(installations, "pro", "LIBERO-PRO")
        self._classification = classification or self._plus.package / CLASSIFICATION
        self._described: dict[tuple[Path, bool], Description] = {}

    def variations(self, source: str) -> tuple[Variation, ...]:
        """Every task of ``plus`` or ``pro``, in the order of its registry.

        Raises:
            ManifestError: LIBERO-Plus's classification is missing, or is that of another registry.
            SubstrateError: A list of tasks cannot be read.
        """
        return self._plus_tasks if source == "plus" else self._pro_tasks

    @cached_property
    def _plus_tasks(self) -> tuple[Variation, ...]:
        return tuple(task for suite in SUITES for task in self._plus_suite(suite))

    def _plus_suite(self, suite: str) -> list[Variation]:
        names, rows = task_names(self._plus, suite), self._classified.get(suite, [])
        if [row.get("name") for row in rows] != list(names):
            raise ManifestError(
                f"{str(self._classification)!r} lists {counted(len(rows), 'task')} of {suite}, and "
                f"{self._plus} has {len(names)}: they are not the same. Give the file of that LIBERO-Plus."
            )
        bases = {name: index for index, name in enumerate(self._libero_names(suite))}
        tasks = []
        for index, (name, row) in enumerate(zip(names, rows, strict=True)):
            base, category = base_name(name), row.get("category")
            if base not in bases or category != plus_category(name):
                raise ManifestError(f"{name!r} is classified as {category!r}, which its name does not say.")
            level = row.get("difficulty_level")
            tasks.append(
                Variation("plus", suite, index, bases[base], name, str(category), "installed", level)
            )
        return tasks

    @cached_property
    def _classified(self) -> Mapping[str, list[Json]]:
        try:
            classified: dict[str, list[Json]] = json.loads(self._classification.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise ManifestError(
                f"LIBERO-Plus's classification cannot be read: {error}. Its package does not have it: give "
                "task_classification.json of its repository (--plus-classification)."
            ) from error
        return classified

    @cached_property
    def _pro_tasks(self) -> tuple[Variation, ...]:
        return tuple(
            Variation("pro", suite, index, index, name, category, "installed", None)
            for category in PRO_CATEGORIES
            for suite in SUITES
            for index, name in enumerate(self._libero_names(suite))
        )

    def _libero_names(self, suite: str) -> tuple[str, ...]:
        return task_names(self._pro, suite)[:_TASKS]

    def lacks(self, variation: Variation, *, models: bool = True) -> str:
        """Return the requirements of a task's scene that are not here, in words; empty for none.

        Args:
            models: True to count LIBERO-Plus's own models and what its motion blur needs.
        """
        if variation.source == "plus":
            needs = self._needs if models else PlusNeeds(False, False, False, False)
            return needs.lacking(variation.name)
        return pro_lacks(self._pro, variation.category, variation.suite, variation.index)

    @cached_property
    def _needs(self) -> PlusNeeds:
        return PlusNeeds.of(self._plus)

    def metadata(self, variation: Variation) -> TaskMetadata:
        """Contents of a task's scene, as far as the choice of an event depends on them.

        Raises:
            SubstrateError: Its file is missing or cannot be read.
        """
        if variation.source == "plus":
            file = description_file(self._plus, variation.suite, variation.name)
            return _metadata(variation.name, sentence(variation.name), self._described_in(file))
        own = task_of(self._pro, variation.suite, variation.index)
        named = self._pro.bddl / self._places(variation)["bddl_file"]
        occluded = variation.category == "view_occlusion" and not named.is_file()
        file = named if named.is_file() else own.bddl
        words = self.variant(variation)
        assert words is not None
        description = self._described_in(file, occluded=occluded)
        reference = self._pro.bddl / self._places(variation)["init_reference_bddl_file"]
        known = self._described_in(reference if reference.is_file() else own.bddl)
        reserved = frozenset(description.objects.keys() - known.objects.keys())
        return _metadata(variation.name, words["language"], description, reserved)

    def variant(self, variation: Variation) -> Json | None:
        """Entry of a task in a manifest's ``substrate_variant``; None for LIBERO-Plus.

        Raises:
            SubstrateError: Its file is missing or cannot be read.
        """
        if variation.source == "plus":
            return None
        own = task_of(self._pro, variation.suite, variation.index)
        files = self._places(variation)
        named = self._pro.bddl / files["bddl_file"]
        language = words_of(named if named.is_file() else own.bddl)
        return {"benchmark": "LIBERO-PRO", "category": variation.category, "language": language, **files}

    def _places(self, variation: Variation) -> dict[str, str]:
        return places(variation.category, variation.suite, variation.name)

    def _described_in(self, file: Path, *, occluded: bool = False) -> Description:
        key = file, occluded
        if key not in self._described:
            text = text_of(file)
            self._described[key] = describe(with_occluder(text) if occluded else text)
        return self._described[key]


def _required(installations: Sequence[Installation], source: str, flavour: Flavour) -> Installation:
    installation = first_of(installations, source)
    if installation is None or installation.flavour != flavour:
        raise SubstrateError(
            f"Tracks on genuine scenes are made of {flavour}, which is not installed. `libero-max doctor` "
            "has the command."
        )
    return installation


def _metadata(
    name: str, language: str, description: Description, reserved: frozenset[str] = frozenset()
) -> TaskMetadata:
    """Return a description in the words of the embedded catalogues."""
    named: list[str] = [*description.objects, *description.fixtures]
    placements: dict[str, Any] = {}
    for predicate, *arguments in description.initial:
        if predicate in ("on", "in") and len(arguments) == 2 and arguments[0] in description.objects:
            subject, region = arguments
            placements[subject] = InitialPlacement(predicate.capitalize(), region, owner(region, named))
    return TaskMetadata(
        name=name,
        language=language,
        objects=description.objects,
        fixtures=description.fixtures,
        objects_of_interest=frozenset(description.interest),
        goal=tuple(Relation(word.capitalize(), tuple(arguments)) for word, *arguments in description.goal),
        placements=placements,
        reserved=reserved,
    )


def describe(text: str) -> Description:
    """Read a BDDL text, or raise SubstrateError."""
    try:
        groups = importlib.import_module("bddl.parsing").scan_tokens(string=text)
        sections = {group[0]: group[1:] for group in groups if isinstance(group, list) and group}
        return Description(
            objects=dict(_typed(sections[":objects"])),
            fixtures=dict(_typed(sections[":fixtures"])),
            interest=tuple(sections[":obj_of_interest"]),
            initial=tuple(_facts(sections[":init"])),
            goal=tuple(_facts(sections[":goal"])),
        )
    except Exception as error:  # the parser raises whatever it likes
        what = f"{type(error).__name__}: {error}"
        raise SubstrateError(f"A task description cannot be read: {what}.") from error


def _typed(words: list[Any]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of name and kind in ``a b - kind c - other``."""
    names: list[str] = []
    kinds = iter(words)
    for word in kinds:
        if word == "-":
            kind = next(kinds)
            yield from ((name, kind) for name in names)
            names = []
        else:
            names.append(word)


def _facts(groups: list[Any]) -> Iterator[Words]:
    """Every innermost group, in order."""
    for group in groups:
        if not isinstance(group, list):
            continue
        if any(isinstance(part, list) for part in group):
            yield from _facts(group)
        elif group:
            yield tuple(group)
