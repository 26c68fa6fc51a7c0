"""An evaluation loop as the subject of rules: the episodes that it played with both spies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from pytest_libero_max.conformance.loop.spies import (
    Array,
    Asked,
    EnvironmentReset,
    Executed,
    Script,
    Spies,
    SpyEnv,
    SpyPolicy,
)
from pytest_libero_max.conformance.python_name import PythonName
from pytest_libero_max.errors import LiberoMaxError
from pytest_libero_max.worlds.global_generators import global_generators_restored

BUDGET = 23
"""Steps of an episode: no multiple of Q, so that its end lies within a chunk."""

EVENT_AT = 8
"""Step of the event in Dynamic, between two queries."""

SUCCESS_AT = 17

BASE = Script(BUDGET)
DYNAMIC = Script(BUDGET, event_at=EVENT_AT, success_at=SUCCESS_AT)
LAST_STEP = Script(BUDGET, success_at=BUDGET)
BEYOND = Script(6, beyond=True)

Loop = Callable[[SpyEnv, SpyPolicy], Any]


class LoopError(LiberoMaxError):
    """A loop that did not play an episode."""


class Source(NamedTuple):
    """The row of an answer that an executed action is."""

    query: Asked
    row: int


@dataclass(frozen=True)
class PlayedEpisode:
    """An episode that the loop played."""

    name: str
    script: Script
    entries: tuple[Any, ...]
    """All that the loop did, in order; see :mod:`.spies`."""
    result: Any

    @property
    def queries(self) -> tuple[Asked, ...]:
        """The queries."""
        return tuple(entry for entry in self.entries if isinstance(entry, Asked))

    @property
    def executed(self) -> tuple[Executed, ...]:
        """The actions of the episode, without those after its end."""
        return tuple(entry for entry in self.entries if isinstance(entry, Executed) and not entry.ended)

    @property
    def resets(self) -> tuple[EnvironmentReset, ...]:
        """The resets of the environment before the end of the episode."""
        resets = [entry for entry in self.entries if isinstance(entry, EnvironmentReset)]
        return (*resets[:1], *(reset for reset in resets[1:] if not reset.ended))

    @property
    def success(self) -> bool | None:
        """The success that the loop returned; None where it returned none."""
        result = self.result
        if isinstance(result, Mapping):
            result = result.get("success", result.get("is_success"))
        array = np.asarray(result)
        if array.size != 1 or array.dtype.kind not in "biuf":
            return None
        return bool(array.reshape(())[()] > 0)


@dataclass
class LoopSubject:
    """A loop, and the episodes that it played one after the other."""

    loop: Loop
    policy: SpyPolicy = field(default_factory=SpyPolicy)

    @cached_property
    def episodes(self) -> dict[str, PlayedEpisode]:
        """The episodes by name, in the order in which they were played."""
        scripts = (("Base", BASE), ("Dynamic", DYNAMIC), ("the third episode", LAST_STEP))
        with global_generators_restored():  # the spy policy draws from them, and a loop may seed them
            return {name: self._played(name, script) for name, script in scripts}

    @cached_property
    def beyond(self) -> PlayedEpisode:
        """An episode with answers beyond 1."""
        with global_generators_restored():
            return self._played("an episode with movements beyond 1", BEYOND)

    @property
    def base(self) -> PlayedEpisode:
        """The first episode: no success, no event."""
        return self.episodes["Base"]

    @property
    def dynamic(self) -> PlayedEpisode:
        """The second episode: an event, then success."""
        return self.episodes["Dynamic"]

    def sources(self, episode: PlayedEpisode) -> Iterator[tuple[int, Executed, Source | None]]:
        """Yield each executed action with its number and the answer that it was; None for no answer's."""
        queries = [query for played in self.episodes.values() for query in played.queries]
        for number, executed in enumerate(episode.executed):
            yield number, executed, _source(executed.action, queries)

    def _played(self, name: str, script: Script) -> PlayedEpisode:
        spies = Spies(script)
        self.policy.spies = spies
        try:
            result = self.loop(SpyEnv(spies), self.policy)
        except (Exception, SystemExit) as error:  # a loop of others may raise anything
            raise LoopError(f"{name}: the loop raised {type(error).__name__}: {error}") from error
        return PlayedEpisode(name, script, tuple(spies.entries), result)


def _source(action: Array, queries: list[Asked]) -> Source | None:
    """Return the row that an action is, by the columns in which no two rows are alike."""
    for query in queries:
        rows = np.flatnonzero(np.abs(query.chunk[:, :3] - action[:3]).max(axis=1) < 1e-3)
        if rows.size:
            return Source(query, int(rows[0]))
    return None


def open_loop(name: str) -> LoopSubject:
    """Return the loop of a name, ``PACKAGE.MODULE:FUNCTION`` or ``FILE.py:FUNCTION``."""
    return LoopSubject(PythonName.read("loop", name).load())
