"""Wall-clock time of a pair: seconds by name, and the watch that may end a call that takes too long.

Nothing here changes what is measured: an episode ends by steps, never by seconds.
"""

from __future__ import annotations

from time import perf_counter
from typing import Protocol


class Clock:
    """Adds up the seconds of named blocks; blocks may nest, and each then counts in full."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}

    def __call__(self, name: str) -> _Stretch:
        """Add the duration of the block to ``name``, also when it raises."""
        return _Stretch(self, name)

    def add(self, name: str, seconds: float) -> None:
        """Add seconds that were measured elsewhere to ``name``."""
        self._seconds[name] = self._seconds.get(name, 0.0) + seconds

    def note_largest(self, name: str, value: float) -> None:
        """Keep the largest value noted under ``name``, which is no duration."""
        self._seconds[name] = max(self._seconds.get(name, value), value)

    @property
    def seconds(self) -> dict[str, float]:
        """Sorted by name, rounded to microseconds."""
        return {name: round(value, 6) for name, value in sorted(self._seconds.items())}


class _Stretch:
    """A block whose duration is added up. Written as a class because every query enters several."""

    __slots__ = ("_begin", "_clock", "_name")

    def __init__(self, clock: Clock, name: str) -> None:
        self._clock, self._name, self._begin = clock, name, 0.0

    def __enter__(self) -> None:
        self._begin = perf_counter()

    def __exit__(self, *error: object) -> None:
        self._clock.add(self._name, perf_counter() - self._begin)


class Watch(Protocol):
    """Is notified before every call that may never return, so that it can end one that takes too long."""

    def query(self) -> None:
        """Note that a call of the policy begins: ``reset`` or ``predict``."""

    def step(self) -> None:
        """Note that work of the simulator begins: a reset, a step, images. It goes on until the next call."""


class NoWatch:
    """A watch without limits."""

    def query(self) -> None: ...

    def step(self) -> None: ...


NO_WATCH = NoWatch()
