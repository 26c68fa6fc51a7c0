"""A source variation as data, the contents of its scene, and the hash draws of catalogues."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.tasks.contents import InitialPlacement, Relation, TaskMetadata, owner, task_metadata
from pytest_libero_max.worlds.contract import AlterableWorld

Item = TypeVar("Item")


@dataclass(frozen=True)
class Variation:
    """A source variation of a task."""

    source: str
    """``plus`` or ``pro``."""
    suite: str
    index: int
    """Index in the catalogue's list of the suite (Plus), or the task's own index, 0 to 9 (PRO)."""
    base_index: int
    """Index of the unmodified task in its suite."""
    name: str
    """Unique within source, suite and category; what a manifest calls ``task_name``."""
    category: str
    """Category of the source."""
    kind: str
    """Kind of variation within the category; a note."""
    difficulty: int | None
    """1 to 5, or None."""
    scene: Json = field(default_factory=dict, hash=False)
    """Differences of the compiled scene, as :class:`~.embedded.remodel.Remodel` reads it."""
    changes: tuple[Json, ...] = field(default=(), hash=False)

    @property
    def key(self) -> str:
        where = f"{self.suite}/{self.index:04d}" if self.source == "plus" else f"{self.suite}/{self.index}"
        return f"{self.source}/{where}" if self.source == "plus" else f"{self.source}/{self.category}/{where}"

    def apply(self, world: AlterableWorld) -> None:
        """Make the changes to a world that has just been reset, or raise ChangeError."""
        from pytest_libero_max.changes.registry import change_from_dict

        for raw in self.changes:
            change_from_dict(raw).apply(world)

    def to_dict(self) -> dict[str, Any]:
        """Everything about it as JSON values."""
        return {
            "source": self.source,
            "suite": self.suite,
            "index": self.index,
            "base_index": self.base_index,
            "name": self.name,
            "category": self.category,
            "kind": self.kind,
            "difficulty": self.difficulty,
            "scene": self.scene,
            "changes": list(self.changes),
        }


def variation_metadata(variation: Variation) -> TaskMetadata:
    """Contents of the scene of a variation, as far as the choice of an event depends on them."""
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
        objects_of_interest=frozenset(name(instance) for instance in task.objects_of_interest),
        goal=tuple(
            Relation(fact.predicate, tuple(name(instance) for instance in fact.arguments))
            for fact in task.goal
        ),
        placements={
            name(key): InitialPlacement(placement.predicate, name(placement.region), support(placement))
            for key, placement in task.placements.items()
        },
    )


def digest_of(variations: Iterable[Variation]) -> str:
    """SHA-256 over the variations in order, hexadecimal."""
    return canonical_digest([variation.to_dict() for variation in variations])


def share(*parts: object) -> float:
    """Return a number above 0 and below 1 that depends on nothing but ``parts``."""
    digest = hashlib.sha256("|".join(str(part) for part in ("libero-max-source", *parts)).encode()).digest()
    return ((int.from_bytes(digest[:8], "big") >> 11) + 0.5) / 2**53


def uniform(low: float, high: float, *parts: object) -> float:
    """Return a number between ``low`` and ``high``, rounded to a millionth."""
    return round(low + (high - low) * share(*parts), 6)


def seed(*parts: object) -> int:
    """32 bits that depend on nothing but ``parts``."""
    return int(share(*parts) * 2**32)


def pick(items: Sequence[Item], *parts: object) -> Item:
    """One of ``items``."""
    return items[math.floor(share(*parts) * len(items))]


def some(items: Sequence[Item], count: int, *parts: object) -> list[Item]:
    """``count`` of ``items``, in their order."""
    ranked = sorted(range(len(items)), key=lambda number: share(*parts, number))
    return [items[number] for number in sorted(ranked[:count])]
