"""Whoever waits for a pair: told what begins, so that it can end what takes too long."""

from __future__ import annotations

from typing import Protocol


class Watch(Protocol):
    """Told when something begins that may never return; what it does about it is its own affair.

    It knows no step budget and changes nothing that is measured: an episode ends by steps, never by seconds.
    """

    def query(self) -> None:
        """A call of the policy begins: ``reset`` or ``predict``."""

    def step(self) -> None:
        """Work of the simulator begins: a reset, a step, images. It goes on until the next call."""


class NoWatch:
    """Waits for ever."""

    def query(self) -> None: ...

    def step(self) -> None: ...


NO_WATCH = NoWatch()
