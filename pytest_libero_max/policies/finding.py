"""Parts of the examination of a policy: observations to show, and findings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

from pytest_libero_max.policies.contract import Episode, Query, query_seed
from pytest_libero_max.worlds.contract import Observation

Level = Literal["ok", "note", "wrong", "skip"]
"""``wrong`` breaks the contract or is never intended; ``note`` may be intended, and deserves attention;
``skip`` could not be examined."""


STRICT = "--strict"
"""Option of ``libero-max check`` that counts probable mistakes as wrong."""


@dataclass(frozen=True)
class Finding:
    """Result of one check."""

    level: Level
    subject: str
    """Property that was examined, for example ``seed``; stable."""
    observed: str
    expected: str = ""
    """The expected behaviour; empty where it was observed."""
    mistake: str = ""
    """The likely mistake and its cure; empty where there is none."""
    probable: bool = False
    """True for a note of what is a mistake of most policies, and intended by few."""

    def strict(self) -> Finding:
        """Return the finding as ``wrong`` if it is a probable mistake, and as it is otherwise."""
        return replace(self, level="wrong", probable=False) if self.probable else self

    def __str__(self) -> str:
        text = f"{self.level:<6}{self.subject}: {self.observed}"
        if self.expected:
            text += f"; expected: {self.expected}"
        text = f"{text}. {self.mistake}" if self.mistake else text
        return f"{text} [{STRICT}: wrong]" if self.probable else text


ok, note, wrong = partial(Finding, "ok"), partial(Finding, "note"), partial(Finding, "wrong")
doubt, skip = partial(Finding, "note", probable=True), partial(Finding, "skip")


@dataclass(frozen=True)
class Shown:
    """Observations and queries that a policy is examined with."""

    episode: Episode
    """Number of all queries."""
    observations: tuple[Observation, ...]
    """At least four that differ in everything, as a world gives them."""

    def query(self, index: int) -> Query:
        """Return the query in which ``observations[index]`` is shown."""
        return Query(index, 5 * index, self.episode.instruction, query_seed(self.episode.seed, index))
