"""The action queue: of every chunk a policy returns, Q actions are executed before it is asked again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Actions = NDArray[np.float64]


class ActionQueue:
    """The actions that will be executed before the next query.

    A query returns n actions, Q <= n <= H. The first Q are queued and executed one by one; the other n - Q
    are never executed, because the next query replaces them.

    Args:
        query_interval: Q.
        pending: (k, dim) actions to begin with, k <= Q.
    """

    def __init__(self, query_interval: int, pending: Actions | None = None) -> None:
        self._query_interval = query_interval
        self._chunk = np.empty((0, 0)) if pending is None else pending.copy()
        self._next = 0

    def __len__(self) -> int:
        return len(self._chunk) - self._next

    def refill(self, actions: Actions) -> None:
        """Replace what is queued with the first Q of (n, dim) actions, n >= Q."""
        self._chunk, self._next = actions[: self._query_interval].copy(), 0

    def pop(self) -> NDArray[Any]:
        """Take the next action, (dim,).

        Raises:
            IndexError: The queue is empty: a query is due.
        """
        action: Actions = self._chunk[self._next]
        self._next += 1
        return action

    @property
    def pending(self) -> Actions:
        """A copy of what is still queued, (k, dim)."""
        return self._chunk[self._next :].copy()
