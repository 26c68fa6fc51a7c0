"""Wall-clock seconds by name: the only thing in a pair record that differs between runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


class Clock:
    """Adds up how long named stretches took; stretches may nest, and each then counts in full."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the duration of the block to ``name``, also when it raises."""
        begin = perf_counter()
        try:
            yield
        finally:
            self.add(name, perf_counter() - begin)

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
