"""Find variations: all of a source, the one that a case plays, and what its scene contains."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ManifestError, SubstrateError, did_you_mean
from pytest_libero_max.substrates.embedded.catalogue.counts import CATEGORIES, SUITES
from pytest_libero_max.substrates.embedded.catalogue.plus_catalogue import plus_suite
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import (
    ANOTHER_GOAL,
    pro_suite,
    pro_variations,
)
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import CATEGORIES as PRO_CATEGORIES
from pytest_libero_max.substrates.variation import Variation, digest_of
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata, owner, task_metadata

Counts = Mapping[tuple[str, str, "int | None"], int]
"""Variations by category, suite and difficulty."""


def catalogue(source: str) -> tuple[Variation, ...]:
    """Every variation of ``plus`` or ``pro``, in order.

    Raises:
        ManifestError: Another source.
    """
    if source == "plus":
        return tuple(variation for suite in SUITES for variation in plus_suite(suite))
    if source == "pro":
        return pro_variations()
    raise ManifestError(f"source={source!r} has no catalogue. {did_you_mean(source, ('plus', 'pro'))}")


def variation_of(case: Case) -> Variation:
    """The variation that a case plays on the embedded substrate.

    Raises:
        SubstrateError: The case names none of the embedded catalogues': it belongs to the genuine LIBERO-Plus
            or LIBERO-PRO, or to another version of these; or its own words ask for another goal than the
            variation's.
    """
    if case.source == "plus":
        suite = plus_suite(case.suite)
        if case.task_index >= len(suite):
            raise SubstrateError(
                f"case {case.case_id!r}: task_index={case.task_index!r}, but the embedded catalogue of "
                f"{case.suite} has {len(suite)} variations."
            )
        variation = suite[case.task_index]
    elif case.source_category in PRO_CATEGORIES and 0 <= case.task_index < 10:
        variation = pro_suite(case.source_category, case.suite)[case.task_index]
    else:
        raise SubstrateError(
            f"case {case.case_id!r}: there is no LIBERO-PRO variation {case.source_category!r} of task "
            f"{case.task_index!r}. {did_you_mean(case.source_category, PRO_CATEGORIES)}"
        )
    said = (case.record.get("task_name", variation.name), case.source_category, case.difficulty)
    if said != (variation.name, variation.category, variation.difficulty):
        raise SubstrateError(
            f"case {case.case_id!r} names {said[0]!r} ({said[1]}, difficulty {said[2]}), but number "
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


def variation_metadata(variation: Variation) -> TaskMetadata:
    """What the scene of a variation contains, as far as the choice of an event depends on it."""
    task = task_metadata(variation.suite, variation.base_index)
    for old, new, category in variation.scene.get("recast", ()):
        task = _recast(task, old, new, category)
    surface = next(name for name, kind in task.fixtures.items() if kind == "floor" or "table" in kind)
    for name, category in variation.scene.get("extras", ()):
        placement = InitialPlacement("On", f"{surface}_{name}_region", surface)
        task = replace(
            task,
            objects={**task.objects, name: category},
            placements={**task.placements, name: placement},
            # What LIBERO-PRO adds hides the target, and no event may take it away.
            reserved=task.reserved | {name} if variation.source == "pro" else task.reserved,
        )
    for change in variation.changes:
        if change["operation"] == "put_object":
            placement = InitialPlacement("On", f"{change['onto']}_put_region", change["onto"])
            if change["object"] != change.get("relative_to"):
                task = replace(task, placements={**task.placements, change["object"]: placement})
        elif change["operation"] in ("set_instruction", "set_task"):
            task = replace(task, language=change["instruction"])
            if "goal" in change:
                goal = tuple(Relation(word.capitalize(), tuple(names)) for word, *names in change["goal"])
                named = {task.entity_of(name) for relation in goal for name in relation.arguments}
                task = replace(
                    task, goal=goal, objects_of_interest=frozenset(name for name in named if name is not None)
                )
    return replace(task, name=variation.name)


def _recast(task: TaskMetadata, old: str, new: str, category: str) -> TaskMetadata:
    def name(text: str) -> str:
        owned = owner(text, [*task.objects, *task.fixtures]) == old
        return new + text[len(old) :] if owned else text

    def support(placement: InitialPlacement) -> str | None:
        return None if placement.support is None else name(placement.support)

    return replace(
        task,
        objects={name(key): category if key == old else kind for key, kind in task.objects.items()},
        fixtures={name(key): category if key == old else kind for key, kind in task.fixtures.items()},
        objects_of_interest=frozenset(name(one) for one in task.objects_of_interest),
        goal=tuple(
            Relation(fact.predicate, tuple(name(one) for one in fact.arguments)) for fact in task.goal
        ),
        placements={
            name(key): InitialPlacement(placement.predicate, name(placement.region), support(placement))
            for key, placement in task.placements.items()
        },
    )


def count_lines() -> list[str]:
    """Variations by category, suite and difficulty, and the catalogues' digests: what a command prints."""
    plus = catalogue("plus")
    counts: Counts = Counter(
        (variation.category, variation.suite, variation.difficulty) for variation in plus
    )
    levels: tuple[int | None, ...] = (1, 2, 3, 4, 5, None)
    head = "".join(f"{'none' if level is None else f'd{level}':>6}" for level in levels)
    lines = [f"{'category':<24}{'suite':<16}{head}{'total':>7}"]
    groups = [*((category, suite) for category in CATEGORIES for suite in (*SUITES, None)), (None, None)]
    for category, suite in groups:
        row = [
            sum(
                count
                for (one, other, found), count in counts.items()
                if category in (one, None) and suite in (other, None) and found == level
            )
            for level in levels
        ]
        numbers = "".join(f"{number:>6}" for number in row)
        lines.append(f"{category or 'all':<24}{suite or 'all':<16}{numbers}{sum(row):>7}")
    pro = catalogue("pro")
    lines.append(f"LIBERO-Plus: {len(plus)} variations, digest {digest_of(plus)}")
    lines.append(
        f"LIBERO-PRO: {len(pro)} variations in {len(PRO_CATEGORIES)} categories, digest {digest_of(pro)}"
    )
    return lines
