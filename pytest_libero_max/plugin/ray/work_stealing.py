"""Hands out pairs so that each player goes through neighbours, which share a scene that is built once."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable


class Shares:
    """The pairs that nobody has begun, as a few runs of neighbours.

    A player without a share takes half of the longest one: its second half, which the owner would reach last.

    Args:
        names: All pairs, in the order of play.
        steal: False: nobody owns a part, and each actor takes the first pair that is left.
    """

    def __init__(self, names: Iterable[str], *, steal: bool = True) -> None:
        self._steal = steal
        self._shares: list[tuple[Hashable | None, deque[str]]] = [(None, deque(names))]

    def __len__(self) -> int:
        return sum(len(share) for _, share in self._shares)

    def take(self, player: Hashable) -> str | None:
        """The next pair of a player; None if all are begun."""
        if not self._steal:
            return self._first()
        own = next((share for owner, share in self._shares if owner == player), None)
        if own is None:
            own = self._part()
            self._shares.append((player, own))
        name = own.popleft() if own else None
        self._shares = [(owner, share) for owner, share in self._shares if share]
        return name

    def give_back(self, name: str) -> None:
        """A pair that was begun is to be played by whoever is free."""
        self._shares.insert(0, (None, deque([name])))

    def leave(self, player: Hashable) -> None:
        """A player is gone: its share is anybody's."""
        self._shares = [(None if owner == player else owner, share) for owner, share in self._shares]

    def _first(self) -> str | None:
        self._shares = [(owner, share) for owner, share in self._shares if share]
        return self._shares[0][1].popleft() if self._shares else None

    def _part(self) -> deque[str]:
        """A part of the longest share: all of it where nobody owns it, otherwise its second half."""
        owner, longest = max(self._shares, key=lambda share: len(share[1]), default=(None, deque[str]()))
        count = len(longest) if owner is None else (len(longest) + 1) // 2
        return deque(reversed([longest.pop() for _ in range(count)]))
