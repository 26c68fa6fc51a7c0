"""The embedded catalogue: all variations of a source, and the one that a case plays."""

from __future__ import annotations

from dataclasses import dataclass

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ManifestError, SubstrateError, counted, did_you_mean
from pytest_libero_max.substrates.embedded.catalogue.plus_catalogue import (
    plus_count,
    plus_suite,
    plus_variation,
)
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import (
    ANOTHER_GOAL,
    pro_suite,
    pro_variations,
)
from pytest_libero_max.substrates.variation import Variation, variation_metadata
from pytest_libero_max.tasks.contents import TaskMetadata
from pytest_libero_max.tasks.libero_tasks import SUITES
from pytest_libero_max.tasks.sources import PRO_CATEGORIES, SOURCES


@dataclass(frozen=True)
class EmbeddedCatalogue:
    """The package's own variations: part of it, so that nothing can be lacking."""

    def variations(self, source: str) -> tuple[Variation, ...]:
        return catalogue(source)

    def metadata(self, variation: Variation) -> TaskMetadata:
        return variation_metadata(variation)

    def variant(self, variation: Variation) -> Json | None:
        return None

    def lacks(self, variation: Variation, *, models: bool = True) -> str:
        return ""


def catalogue(source: str) -> tuple[Variation, ...]:
    """Every variation of ``plus`` or ``pro``, in order, or raise ManifestError."""
    if source == "plus":
        return tuple(variation for suite in SUITES for variation in plus_suite(suite))
    if source == "pro":
        return pro_variations()
    raise ManifestError.seen("source", source, f" has no catalogue. {did_you_mean(source, SOURCES)}")


def variation_of(case: Case) -> Variation:
    """Return the variation that a case plays on the embedded substrate.

    Raises:
        SubstrateError: The case names none of the embedded catalogues': it belongs to the genuine LIBERO-Plus
            or LIBERO-PRO, or to another version of these; or its own words ask for another goal than the
            variation's.
    """
    if case.source == "plus":
        count = plus_count(case.suite)
        if case.task_index >= count:
            raise SubstrateError(
                f"case {case.case_id!r}: task_index={case.task_index!r}, but the embedded catalogue of "
                f"{case.suite} has {counted(count, 'variation')}."
            )
        variation = plus_variation(case.suite, case.task_index)
    elif case.source_category in PRO_CATEGORIES and 0 <= case.task_index < 10:
        variation = pro_suite(case.source_category, case.suite)[case.task_index]
    else:
        raise SubstrateError(
            f"case {case.case_id!r}: there is no LIBERO-PRO variation {case.source_category!r} of task "
            f"{case.task_index!r}. {did_you_mean(case.source_category, PRO_CATEGORIES)}"
        )
    claimed = (case.record.get("task_name", variation.name), case.source_category, case.difficulty)
    if claimed != (variation.name, variation.category, variation.difficulty):
        raise SubstrateError(
            f"case {case.case_id!r} names {claimed[0]!r} ({claimed[1]}, difficulty {claimed[2]}), but number "
            f"{case.task_index} of the embedded catalogue is {variation.name!r} ({variation.category}, "
            f"difficulty {variation.difficulty}). Cases of the genuine LIBERO-Plus and LIBERO-PRO are played "
            "on substrate libero, with their source variations as installed, not this package's own."
        )
    _require_same_goal(case, variation)
    return variation


def _require_same_goal(case: Case, variation: Variation) -> None:
    """Refuse a case whose own words ask for another goal than the one that the variation is scored by."""
    published = ANOTHER_GOAL.get((variation.category, variation.suite, variation.index))
    if variation.source != "pro" or published is None or case.instruction is None:
        return
    words = variation_metadata(variation).language
    if case.instruction.lower() != words.lower():
        raise SubstrateError(
            f"case {case.case_id!r} tells the policy {case.instruction!r}, but is scored by {words!r} on the "
            f"embedded scenes: LIBERO-PRO's task is {published}. Play it on substrate libero or leave it out."
        )
