"""The contract of an event kind: everything that is the same for all cases of one event."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, get_args

from pytest_libero_max.benchmark.cases import SEVERITIES, Event
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.triggers import Proximity, Trigger

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

Response = Literal["continue", "replan", "follow_update", "stop"]

VARIANTS = (0, 1)
"""Every event has two parameter variants."""


class Scenario(NamedTuple):
    """Effect of an event, as a manifest spells it."""

    change: Json
    """The change in the middle of the episode: an ``operation`` and its parameters."""
    setup: tuple[Json, ...] = ()
    """Changes that both arms share, applied right after reset."""


class EventKind(ABC):
    """An event: its names, which tasks can host it, and how its parameters are drawn.

    A subclass is one file in ``events/kinds``, or an entry point of a package of your own. Its docstring says
    what happens to the world.
    """

    name: ClassVar[str]
    """In manifests, ids, markers and reports: lower case letters, digits and underscores."""
    family: ClassVar[str]
    """The paper's family, by which results are grouped; also a marker."""
    code: ClassVar[str]
    """The family code of the manifests, for example ``OBS``."""
    severities: ClassVar[tuple[str, str]]
    """Severity of variant 0 and of variant 1: ``low``, ``medium`` or ``high``."""
    response: ClassVar[Response]
    """The manifests' word for the expected response of a policy: ``continue`` where the task stays the same,
    ``replan`` where the target, the destination or the path has changed, ``follow_update`` where there is
    another task, ``stop`` where there is none any more."""
    needs: ClassVar[str] = "an entity that the hand comes near: its target, or what its goal names first."
    """Requirement of a task, in words that follow "The task needs"."""
    expected: ClassVar[str]
    """Expected response of a policy, in a sentence."""
    drawn: ClassVar[bool] = True
    """False if only manifests spell such events out, and none are drawn for a task."""

    def eligible(self, task: TaskMetadata) -> bool:
        """Return True if the task can host the event; decided from the task's description alone."""
        return task.trigger_entity is not None

    def trigger(self, task: TaskMetadata) -> Trigger:
        """Return the trigger in an eligible task: the hand comes near the trigger entity.

        Another trigger must name an entity in ``value``, which the distances of every record are about.
        """
        return Proximity(entity_of(task), task.trigger_distance_m)

    @abstractmethod
    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        """Fix every parameter for an eligible task."""

    @abstractmethod
    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Scenarios of this event for a world with these entities, for Hypothesis.

        Import Hypothesis in here, not at the top of the module: playing a pair must not need it.

        Args:
            entities: The world's entities by name.
        """

    def event(self, variant: int, seed: int, scenario: Scenario, trigger: Trigger) -> Event:
        """Return the event of a case, with everything that is the same for all events of this kind."""
        return Event(
            name=self.name,
            variant=variant,
            seed=seed,
            severity=self.severities[variant],
            family_code=self.code,
            response=self.response,
            change=scenario.change,
            setup=scenario.setup,
            trigger=trigger.to_dict(),
        )


def entity_of(task: TaskMetadata) -> str:
    """Return the trigger entity of a task that an event is possible in."""
    assert task.trigger_entity is not None  # eligibility demands it
    return task.trigger_entity


_WORD = re.compile(r"[a-z][a-z0-9_]*")


def accept_kind(name: str, candidate: object) -> EventKind:
    """Return the event kind registered under a name: a subclass of :class:`EventKind`, or an instance of one.

    Raises:
        ValueError: It is neither, or one of its attributes breaks a rule.
    """
    if isinstance(candidate, type) and issubclass(candidate, EventKind):
        candidate = candidate()
    if not isinstance(candidate, EventKind):
        raise ValueError(f"{candidate!r} is not a subclass of pytest_libero_max.events.kind.EventKind")
    lacking = [
        attribute
        for attribute in ("name", "family", "code", "severities", "response", "expected")
        if not hasattr(candidate, attribute)
    ]
    if lacking:
        raise ValueError(f"{type(candidate).__name__} lacks {', '.join(lacking)}")
    for attribute in ("name", "family"):
        word = getattr(candidate, attribute)
        if not isinstance(word, str) or not _WORD.fullmatch(word):
            raise ValueError(
                f"{attribute}={word!r}, but must be a word of lower case letters, digits and underscores, "
                "since it is a pytest marker and a part of test ids"
            )
    if not isinstance(candidate.code, str) or not candidate.code:
        raise ValueError(f"code={candidate.code!r}, but must be a family code such as 'OBS'")
    if len(candidate.severities) != len(VARIANTS) or not {*candidate.severities} <= {*SEVERITIES}:
        raise ValueError(
            f"severities={candidate.severities!r}, but must be two of {', '.join(SEVERITIES)}: "
            "of variant 0 and 1"
        )
    if candidate.response not in get_args(Response):
        raise ValueError(
            f"response={candidate.response!r}, but must be one of {', '.join(get_args(Response))}"
        )
    return candidate
