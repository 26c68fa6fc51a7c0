"""One source variation as data, and the hash draws that catalogues are made of."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from pytest_libero_max.benchmark.cases import Source
from pytest_libero_max.benchmark.documents import Json, canonical_digest
from pytest_libero_max.worlds.contract import World

Item = TypeVar("Item")


@dataclass(frozen=True)
class Variation:
    """A source variation of a task.

    Attributes:
        source: ``plus`` or ``pro``.
        suite: LIBERO suite.
        index: Index in the catalogue's list of the suite (Plus), or the task's own index, 0 to 9 (PRO).
        base_index: Index of the unmodified task in its suite.
        name: Unique within source, suite and category; what a manifest calls ``task_name``.
        category: Category of the source.
        kind: Which kind of variation within the category; a note.
        difficulty: 1 to 5, or None.
        scene: How the compiled scene differs, as :class:`~.worlds.embedded.remodel.Remodel` reads it.
        changes: Changes at reset, in order, as a manifest spells them.
    """

    source: Source
    suite: str
    index: int
    base_index: int
    name: str
    category: str
    kind: str
    difficulty: int | None
    scene: Json = field(default_factory=dict, hash=False)
    changes: tuple[Json, ...] = field(default=(), hash=False)

    @property
    def key(self) -> str:
        where = f"{self.suite}/{self.index:04d}" if self.source == "plus" else f"{self.suite}/{self.index}"
        return f"{self.source}/{where}" if self.source == "plus" else f"{self.source}/{self.category}/{where}"

    def apply(self, world: World) -> None:
        """Make the changes to a world that has just been reset.

        Raises:
            ChangeError: The world is not that of the variation's scene.
        """
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


def digest_of(variations: Iterable[Variation]) -> str:
    """SHA-256 over the variations in order, hexadecimal."""
    return canonical_digest([variation.to_dict() for variation in variations])


def share(*parts: object) -> float:
    """A number above 0 and below 1 that depends on nothing but ``parts``."""
    digest = hashlib.sha256("|".join(str(part) for part in ("libero-max-source", *parts)).encode()).digest()
    return ((int.from_bytes(digest[:8], "big") >> 11) + 0.5) / 2**53


def uniform(low: float, high: float, *parts: object) -> float:
    """A number between ``low`` and ``high``, rounded to a millionth."""
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
