"""The contract of a policy: it begins episodes, answers queries, and sees only inputs that it declares."""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, Protocol, get_args, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.structs import Name, fits
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.worlds.contract import Control, ImageSize, Observation, World
from pytest_libero_max.worlds.robot import CAMERAS, PANDA, ROBOTS, Robot

MemoryKind = Literal["none", "snapshot", "queries", "frames"]
"""The way to bring a policy's memory to the event: not at all, as a copy, by asking all queries again, or
by showing every step again."""


CHANCE_SHARE = 0.2
"""Share of the pairs that measure the chance of a policy that is not repeatable, unless the user sets it."""

MOST = MappingProxyType({"horizon": 10_000, "query_interval": 10_000, "image_size": 4096})
"""Largest values of a spec: an episode is shorter, and an answer or an image has to fit in memory."""


@dataclass(frozen=True)
class PolicySpec:
    """A policy's declaration about itself; part of every result.

    Raises:
        AdapterError: A value breaks its rule.
    """

    name: str
    """Shown in reports."""
    horizon: int = 1
    """H (chunk size), the most actions a query may return."""
    query_interval: int = 1
    """Q (execution horizon, replan steps), the actions executed before the next query; at most H."""
    cameras: tuple[str, ...] = CAMERAS
    """The images it wants in every observation. None are rendered for an empty tuple."""
    image_size: ImageSize = 256
    """Side of square images, or height and width, pixels."""
    privileged: bool = False
    """True if it reads the simulator's state through ``episode.world``."""
    repeatable: bool = True
    """True if the same observation and query give the same bytes again. The pair runner checks it on policies
    without a snapshot; False, for a server whose arithmetic varies, switches that check off."""
    revision: str | None = None
    """Identity of the weights among others of the same name, for example a checkpoint's commit or digest.
    Kept with every result."""
    suites: tuple[str, ...] | None = None
    """The suites it can play, or None for all. Pairs of other suites are unsupported: they are
    skipped, and neither played nor failed."""
    control: Control = "delta"
    """Kind of its actions: movements (``delta``), or poses of the grip site in the world (``absolute``:
    position in m, axis times angle in rad)."""
    wrappers: tuple[str, ...] = ()
    """Wrappers around the policy, from the inside out, for example ``restore=gated``."""
    robot: str | None = PANDA.name
    """Name of the robot that its actions are for, or None for any: it then reads ``episode.robot``. On
    another one it is refused."""
    history: bool = False
    """True if its answers depend on all that it was asked before in the episode, without a ``snapshot``. It
    is then asked all of it again on the way to the event."""

    def __post_init__(self) -> None:
        if not self.name:
            raise AdapterError("name='' but a policy needs a name; it labels the report.")
        if not fits(self.name, Name):
            raise AdapterError.seen(
                "name", self.name, " of a policy, but must be printable text on one line."
            )
        for field in ("horizon", "query_interval"):
            object.__setattr__(self, field, self._count(field, getattr(self, field)))
        object.__setattr__(self, "image_size", self._size())
        if self.revision is not None and not (isinstance(self.revision, str) and self.revision):
            raise self._refusal("revision", "must be None or a string that is not empty")
        if not isinstance(self.history, bool):
            raise self._refusal("history", "must be True or False")
        if self.control not in get_args(Control):
            raise AdapterError.seen(
                "control",
                self.control,
                f" of policy {self.name!r}. {did_you_mean(str(self.control), get_args(Control))}",
            )
        if self.robot is not None and self.robot not in ROBOTS:
            raise AdapterError.seen(
                "robot", self.robot, f" of policy {self.name!r}. {ROBOTS.none_called(str(self.robot))}"
            )
        if self.suites is not None:
            object.__setattr__(self, "suites", self._known_suites())
        if self.query_interval > self.horizon:
            raise AdapterError(
                f"query_interval={self.query_interval} > horizon={self.horizon} of policy {self.name!r}: "
                "a query returns at most H actions, so no more than H can be executed before the next "
                "(Q <= H). Lower Q (--libero-max-query-interval) or raise H (--libero-max-horizon)."
            )
        if isinstance(self.cameras, str):
            raise self._refusal("cameras", "must be a tuple of names")
        object.__setattr__(self, "cameras", tuple(self.cameras))

    def supports(self, suite: str) -> bool:
        """Return True if the policy can play the pairs of a suite."""
        return self.suites is None or suite in self.suites

    def _known_suites(self) -> tuple[str, ...]:
        if isinstance(self.suites, str) or not self.suites:
            raise self._refusal("suites", "must be None or a tuple of names")
        for suite in self.suites:
            if suite not in SUITES:
                raise AdapterError.seen(
                    "suites",
                    self.suites,
                    f" of policy {self.name!r} names the unknown suite {suite!r}. "
                    f"{SUITES.none_called(str(suite))}",
                )
        return tuple(sorted({*self.suites}))

    def _size(self) -> ImageSize:
        """Return the size of the images; one number where they are square, so that equal sizes are equal."""
        value = self.image_size
        if not isinstance(value, list | tuple):
            return self._count("image_size", value)
        if len(value) != 2:
            raise self._refusal("image_size", "must be a side, or height and width")
        height, width = (self._count("image_size", side) for side in value)
        return height if height == width else (height, width)

    def _count(self, field: str, value: Any) -> int:
        """Return a number as a plain int, so that NumPy's integers can be written as JSON."""
        try:
            count = operator.index(value)
        except TypeError:
            count = 0
        if isinstance(value, bool | np.bool_) or count < 1:
            raise self._refusal(field, "must be an integer of at least 1", value)
        if count > MOST[field]:
            raise self._refusal(field, f"may be {MOST[field]} at most", value)
        return count

    def _refusal(self, field: str, rule: str, *part: Any) -> AdapterError:
        """Return the error of a field, or of a part of its value, that breaks a rule."""
        value = part[0] if part else getattr(self, field)
        return AdapterError.seen(field, value, f" of policy {self.name!r}, but {rule}.")

    @property
    def components(self) -> int | None:
        """Number of components of its actions; None where it is for any robot."""
        return None if self.robot is None else ROBOTS[self.robot].components

    def to_dict(self) -> dict[str, Any]:
        """Return JSON types; without the fields from ``suites`` on where they are at their defaults.

        A robot is named where it is another one than LIBERO's.
        """
        values = {
            name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()
        }
        for name, default in (("suites", None), ("wrappers", []), ("history", False), ("control", "delta")):
            value = values.pop(name)
            if value != default:
                values[name] = value
        if self.robot in (None, PANDA.name):
            del values["robot"]
        return values


@dataclass(frozen=True, eq=False)
class Handover:
    """Rollout of another policy in the middle of which a policy takes over."""

    policy: str
    """Name of the policy that acted before."""
    step: int
    """Policy steps executed so far."""
    executed: NDArray[np.float64]
    """(step, 7) all actions executed so far, in their order; read only."""
    remaining: NDArray[np.float64]
    """(k, 7) actions of the last chunk that the robot would execute next, without those beyond Q; read only.
    A policy that is asked at once replaces them, but for those executed until its answer is there."""


@dataclass(frozen=True)
class Episode:
    """Description of an episode, for a policy when it begins."""

    suite: str
    """Suite of the task."""
    task_index: int
    """Index of the task in its source's registry."""
    instruction: str
    """The task in words."""
    seed: int
    """The policy seed of the case, the same in both arms."""
    max_steps: int
    """Policy steps the episode may take."""
    world: World | None = None
    """The live world for a policy that declares itself privileged, otherwise None. Read only."""
    handover: Handover | None = None
    """The rollout so far, where the policy takes over from another one; None for an episode of its own."""
    robot: Robot = PANDA
    """The robot of the world."""


@dataclass(frozen=True)
class Query:
    """One call for actions."""

    index: int
    """Number of this query in the episode, from 0."""
    step: int
    """Policy steps executed before it."""
    instruction: str
    """The task in words."""
    seed: int
    """Derived from (policy seed, query index) alone: a policy that draws from nothing else repeats itself
    exactly, whatever order servers see its queries in."""


@runtime_checkable
class Policy(Protocol):
    """The two methods and one attribute every adapter has.

    A policy with memory also offers ``snapshot() -> object`` and ``restore(object)``, so that the Dynamic
    rollout can begin with the memory Base had at the event. Without them the policy must be a function
    of the observation and the query, unless its memory consists of the steps it was shown (``see``) or asked
    (``PolicySpec(history=True)``): then it is shown or asked all of it again. ``reset`` is called at the
    start of both rollouts; the Dynamic rollout may start at the event, so a privileged policy must not take
    the world it finds then for the initial state.

    A policy may keep counts of its last query by name in ``query_notes``; the record holds their sums.
    """

    spec: PolicySpec

    def reset(self, episode: Episode) -> None:
        """Forget everything: a new episode begins."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        """Actions for the coming steps, (n, 7) with Q <= n <= H, within [-1, 1] or poses, as declared."""


@runtime_checkable
class SeeingPolicy(Policy, Protocol):
    """A policy that is shown the world before every step, not only at queries.

    Every step then costs an observation. Without ``snapshot`` its memory consists of the steps it was shown:
    all of them are shown again on the way to the event.
    """

    def see(self, observation: Observation, step: int) -> None:
        """Receive the observation before a step; where a query is due, ``predict`` gets it right after."""


@runtime_checkable
class RemembersPolicy(Policy, Protocol):
    """A policy whose memory can be copied."""

    def snapshot(self) -> object:
        """Return a copy of everything that later answers depend on; the policy must not write to it."""

    def restore(self, memory: object) -> None:
        """Remember what ``snapshot`` copied; the copy must stay as it is, to be restored again."""


@dataclass(frozen=True)
class BatchItem:
    """One of several queries that a policy answers together."""

    observation: Observation
    """The world's observation."""
    query: Query
    """The query."""
    episode: Episode
    """The episode it belongs to. The items of a batch may be of different episodes."""


@runtime_checkable
class BatchPolicy(Policy, Protocol):
    """A policy that can answer several queries together, of which ``libero-max serve`` makes use.

    A policy with memory is asked one query at a time, whatever it offers.
    """

    def predict_batch(self, items: Sequence[BatchItem]) -> Sequence[NDArray[np.float64]]:
        """Return what ``predict`` returns for each of the items, in their order.

        ``reset`` is not called for them: all that an answer depends on is in its item.
        """


def published_seed(policy_seed: int, query: Query) -> int:
    """Seed of a query as LIBERO-MAX's authors derive it: the first four bytes of SHA-256 of ``seed:index``.

    A query after new seeds (a sham event), which they do not have, keeps its own seed.
    """
    if query.seed != query_seed(policy_seed, query.index):
        return query.seed
    return int.from_bytes(hashlib.sha256(f"{policy_seed}:{query.index}".encode()).digest()[:4], "big")


def query_seed(policy_seed: int, index: int, reseeds: int = 0) -> int:
    """Seed of a query, 0 to 2**32 - 1: the first four bytes of SHA-256 of ``libero-max-query|seed|index``.

    Args:
        index: Number of the query in the episode, from 0.
        reseeds: Number of times that the policy was given new seeds before it; ends the text if not 0.
    """
    suffix = f"|{reseeds}" if reseeds else ""
    digest = hashlib.sha256(f"libero-max-query|{policy_seed}|{index}{suffix}".encode()).digest()
    return int.from_bytes(digest[:4], "big")


__all__ = [
    "BatchItem",
    "BatchPolicy",
    "Episode",
    "Handover",
    "Policy",
    "PolicySpec",
    "Query",
    "RemembersPolicy",
    "SeeingPolicy",
    "query_seed",
]
