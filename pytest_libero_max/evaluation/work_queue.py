"""Queue of pairs for actors: each plays neighbours, which share a scene, and an idle one steals work."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable


class WorkQueue:
    """Pairs that no actor has begun, in parts of neighbours.

    An idle actor takes the part that nobody owns, or steals the second half of the longest part, which its
    owner would reach last.

    Args:
        names: All pairs, in the order of play.
        steal: False: nobody owns a part, and each actor takes the first pair of all that are left.
    """

    def __init__(self, names: Iterable[str], *, steal: bool = True) -> None:
        self._steal = steal
        self._parts: list[tuple[Hashable | None, deque[str]]] = [(None, deque(names))]

    def __len__(self) -> int:
        return sum(len(part) for _, part in self._parts)

    def take(self, actor: Hashable) -> str | None:
        """Remove and return the next pair of an actor; None if every pair is begun."""
        own = self._first() if not self._steal else self._owned(actor)
        name = own.popleft() if own else None
        self._parts = [(owner, part) for owner, part in self._parts if part]
        return name

    def give_back(self, name: str) -> None:
        """Put a pair that was begun in front, for any actor."""
        self._parts.insert(0, (None, deque([name])))

    def leave(self, actor: Hashable) -> None:
        """Let the part of an actor that is lost be anybody's."""
        self._parts = [(None if owner == actor else owner, part) for owner, part in self._parts]

    def _first(self) -> deque[str] | None:
        return self._parts[0][1] if self._parts else None

    def _owned(self, actor: Hashable) -> deque[str]:
        part = next((part for owner, part in self._parts if owner == actor), None)
        if part is None:
            part = self._stolen()
            self._parts.append((actor, part))
        return part

    def _stolen(self) -> deque[str]:
        """Cut off a part for an idle actor: the longest one if it has no owner, else its second half."""
        owner, longest = max(self._parts, key=lambda part: len(part[1]), default=(None, deque[str]()))
        count = len(longest) if owner is None else (len(longest) + 1) // 2
        return deque(reversed([longest.pop() for _ in range(count)]))
