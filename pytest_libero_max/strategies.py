"""Hypothesis strategies for the parts of a benchmark: changes, events, cases, actions, policies.

For the tests of this project and for those of anybody who writes a change, an adapter or a world of
their own. They need nothing but the names of a world's entities, so they fit every world; the cheap one is
:class:`pytest_libero_max.TinyWorld`, whose entities are meant wherever none are given::

    from hypothesis import given
    from pytest_libero_max import TinyWorld, strategies

    world = TinyWorld()

    @given(strategies.changes(world.entities), strategies.action_sequences(max_size=5))
    def test_nothing_survives_a_reset(change, actions):
        world.reset(0)
        fresh = world.digest()
        change.apply(world)
        for action in actions:
            world.step(action)
        world.reset(0)
        assert world.digest() == fresh

Hypothesis is imported when this module is, and by nothing that plays a pair.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Literal

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import TRIGGER_DISTANCE_M, Case, Event
from pytest_libero_max.benchmark.cases import parse_case as _parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.change_strategies import (
    AT_ONCE,
    SEEDS,
    Entities,
    alters,
    changes,
    entities_or_tiny,
    objects_of,
    strengths,
)
from pytest_libero_max.events.kind import VARIANTS
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.tasks.suites import LIBERO_SUITES
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import ACTION_DIM

if TYPE_CHECKING:
    from pytest_libero_max.substrates.variation import Variation

__all__ = [
    "AT_ONCE",
    "SOURCES",
    "RememberingPolicy",
    "ScriptedPolicy",
    "action_sequences",
    "actions",
    "cases",
    "changes",
    "events",
    "manifests",
    "scripted_policies",
    "source_variations",
    "strengths",
    "varied_cases",
]

SOURCES = ("plus", "pro")


@st.composite
def events(
    draw: st.DrawFn,
    entities: Entities | None = None,
    *,
    names: Iterable[str] | None = None,
    distances_m: SearchStrategy[float] | None = None,
) -> Event:
    """Events of every kind, with setup and trigger, for a world with these entities.

    Args:
        entities: The world's entities; by default those of the tiny world.
        names: Names of events; by default all that are registered and drawn.
        distances_m: Trigger distances; by default the benchmark's. A large one fires at the first step.
    """
    known = entities_or_tiny(entities)
    kind = EVENTS[draw(st.sampled_from(sorted(_drawn() if names is None else names)))]
    trigger = draw(st.sampled_from(objects_of(known)))
    seed = draw(SEEDS)
    scenario = draw(kind.strategy(known, trigger, seed).filter(lambda it: alters(it.change)))
    distance = draw(distances_m) if distances_m is not None else TRIGGER_DISTANCE_M
    return kind.event(draw(st.sampled_from(VARIANTS)), seed, scenario, Proximity(trigger, distance))


def _drawn() -> list[str]:
    """Return the names of the events that are drawn for tasks."""
    return [name for name, kind in EVENTS.items() if kind.drawn]


@st.composite
def cases(
    draw: st.DrawFn,
    entities: Entities | None = None,
    *,
    events: SearchStrategy[Event] | None = None,
    suites: Iterable[str] = LIBERO_SUITES,
) -> Case:
    """Cases of unmodified tasks, playable in any world with these entities and ten initial states.

    Args:
        entities: The world's entities; by default those of the tiny world.
        events: Strategy of the events; by default :func:`events` of the entities.
        suites: Suites; they decide the step budget.
    """
    event = draw(events if events is not None else _events_of(entities))
    identity = Identity(
        "libero", draw(st.sampled_from(sorted(suites))), draw(st.integers(0, 9)), draw(st.integers(0, 9))
    )
    record = case_record(identity, event, "a_scripted_task")
    return _parse_case(record)


def source_variations(source: Literal["plus", "pro"] | None = None) -> SearchStrategy[Variation]:
    """Source variations of the embedded scenes; by default of both catalogues.

    Args:
        source: Only this one's.
    """
    sources = SOURCES if source is None else (source,)
    return st.deferred(lambda: st.one_of(*map(_catalogue, sources)))


@st.composite
def varied_cases(draw: st.DrawFn, source: Literal["plus", "pro"] | None = None) -> Case:
    """Cases that the benchmark could hold: a source variation, an event that its scene can host.

    Args:
        source: Only on this source's variations.
    """
    from pytest_libero_max.events.configurations import PRO_STATES, Cell, Configuration
    from pytest_libero_max.events.registry import eligible_events
    from pytest_libero_max.substrates.variation import variation_metadata

    variation = draw(source_variations(source))
    event = draw(st.sampled_from(eligible_events(variation_metadata(variation))))
    init = draw(st.integers(0, PRO_STATES - 1)) if variation.source == "pro" else 0
    return Configuration(variation, init).case(Cell(variation.category, event, draw(st.integers(0, 1))))


def manifests(entities: Entities | None = None, *, max_size: int = 6) -> SearchStrategy[Manifest]:
    """Manifests of up to ``max_size`` distinct cases."""
    distinct = st.lists(cases(entities), min_size=1, max_size=max_size, unique_by=lambda case: case.item_id)
    return distinct.map(lambda drawn: Manifest.of("drawn", drawn))


def actions(limit: float = 1.5) -> SearchStrategy[tuple[float, ...]]:
    """(7,) actions with components up to ``limit``; a controller clips beyond 1."""
    component = st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(-limit, limit)
    return st.tuples(*[component] * ACTION_DIM)


def action_sequences(
    *, min_size: int = 1, max_size: int = 20, limit: float = 1.5
) -> SearchStrategy[list[tuple[float, ...]]]:
    """Return lists of :func:`actions`, one for each control step."""
    return st.lists(actions(limit), min_size=min_size, max_size=max_size)


class ScriptedPolicy:
    """A deterministic policy whose actions depend on observation, query and a table of actions.

    The first of the returned actions is the table's for the step of the query. All of them are shifted
    by the query's seed and by the end effector's position, so that a wrong seed, a wrong step or a stale
    observation shows in the actions.

    Args:
        spec: Horizon, query interval and cameras.
        table: (n, 7) actions, repeated for ever.
        length: Number of actions returned, Q to H.
        drift: (3,) added to the translation, to make it reach something.
    """

    def __init__(
        self,
        spec: PolicySpec,
        table: Iterable[Iterable[float]],
        length: int,
        drift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        self.spec = spec
        self.table: NDArray[np.float64] = np.array(list(table), dtype=np.float64)
        self.length = length
        self.drift = drift

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}(H={self.spec.horizon}, Q={self.spec.query_interval}, "
            f"cameras={self.spec.cameras}, length={self.length}, "
            f"table={self.table.tolist()}, drift={self.drift})"
        )

    def reset(self, episode: Episode) -> None:
        """Forget everything."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        """(length, 7) actions within [-1, 1]."""
        steps = query.step + np.arange(self.length)
        shift = query.seed / 2**32 - 0.5 + np.sin(50.0 * observation["robot0_eef_pos"].sum())
        chunk = self.table[steps % len(self.table)] + 0.2 * shift
        chunk[:, :3] += self.drift
        clipped: NDArray[np.float64] = chunk.clip(-1.0, 1.0)
        return clipped


class RememberingPolicy(ScriptedPolicy):
    """A :class:`ScriptedPolicy` whose actions also depend on everything it has seen in the episode."""

    def reset(self, episode: Episode) -> None:
        self._memory = 0.0

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        seen = float(observation["robot0_eef_pos"].sum())
        self._memory = 0.5 * self._memory + np.sin(50.0 * seen)
        chunk = super().predict(observation, query)
        remembered: NDArray[np.float64] = (chunk + 0.2 * self._memory).clip(-1.0, 1.0)
        return remembered

    def snapshot(self) -> object:
        """Return a copy of the memory."""
        return self._memory

    def restore(self, memory: object) -> None:
        """Go back to a copied memory."""
        assert isinstance(memory, float)
        self._memory = memory


@st.composite
def scripted_policies(
    draw: st.DrawFn,
    *,
    max_horizon: int = 12,
    memory: bool | None = None,
    cameras: tuple[str, ...] = (),
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> ScriptedPolicy:
    """Deterministic policies with any H and Q, with or without memory.

    Args:
        max_horizon: Largest H.
        memory: True if it remembers (and offers ``snapshot`` and ``restore``); None draws both.
        cameras: The images it asks for; none by default, so that nothing is rendered.
        drift: (3,) added to the translation of every action, to make it reach something.
    """
    horizon = draw(st.integers(1, max_horizon))
    interval = draw(st.integers(1, horizon))
    spec = PolicySpec("scripted", horizon, interval, cameras, image_size=32)
    remembers = draw(st.booleans()) if memory is None else memory
    kind = RememberingPolicy if remembers else ScriptedPolicy
    table = draw(st.lists(actions(1.0), min_size=1, max_size=8))
    return kind(spec, table, draw(st.integers(interval, horizon)), drift)


def _catalogue(source: str) -> SearchStrategy[Variation]:
    from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue

    return st.sampled_from(catalogue(source))


def _events_of(entities: Entities | None) -> SearchStrategy[Event]:
    return events(entities)
