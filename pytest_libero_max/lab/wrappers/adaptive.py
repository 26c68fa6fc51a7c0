"""Early queries of a policy where the scene has changed: a baseline for adaptive policies.

The paper names adaptive policies as future work. This one changes only the times of the policy's queries: it
executes whole chunks, and asks again before the end of one where the world departs from the state that the
chunk was planned for, within the budget of a fixed query interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from pytest_libero_max.errors import AdapterError, did_you_mean
from pytest_libero_max.policies.check import Actions, ask
from pytest_libero_max.policies.contract import Episode, Policy, Query, query_seed
from pytest_libero_max.policies.wrapping import WrappedPolicy
from pytest_libero_max.worlds.contract import Array, Image, Observation, World
from pytest_libero_max.worlds.robot import GRIPPER, ROBOT

AdaptiveMode = Literal["image", "privileged"]
ADAPTIVE_MODES: tuple[AdaptiveMode, ...] = get_args(AdaptiveMode)
"""Signals to watch. ``image``: the images of the fixed cameras. ``privileged``: the objects' positions."""

BLOCKS = 16
"""Number of blocks along each side of an image."""
SURPRISE = 30.0
"""Least change of a block, beyond that of it and its neighbours before, that counts, grey levels. In the six
embedded scenes examined the robot's movement stayed below 21, and the weakest event gave 43."""
MOVED_M = 0.02
"""Largest displacement of an object since the query, if no part of the robot touches it, m."""

_ON_THE_HAND = "eye_in_hand"


@dataclass(frozen=True)
class _Memory:
    """State between two steps."""

    chunk: Actions
    """Actions of the last answer that are left to execute."""
    asked: int = 0
    """Number of queries of the inner policy."""
    images: tuple[Image, ...] = ()
    """Images of the fixed cameras at the last step."""
    changes: tuple[Array, ...] = ()
    """Change of each of their blocks then."""
    places: Mapping[str, Array] | None = None
    """Position of each object at the last query, (3,) m."""
    inner: object = None


class AdaptivePolicy(WrappedPolicy):
    """Watches every step, hands out a chunk action by action, and asks early where something changed.

    At any step of an episode it has made at most as many queries as a fixed interval of Q, that of the inner
    policy; queries that it saves by executing whole chunks (H actions) are spent on early ones.

    Attributes:
        query_notes: Counts of the last query: looks, asked, early, and those of a wrapper inside.

    Raises:
        AdapterError: There is nothing to watch: no fixed camera, or a policy that is not privileged.
    """

    modes = ADAPTIVE_MODES

    def __init__(self, policy: Policy, mode: AdaptiveMode) -> None:
        if mode not in ADAPTIVE_MODES:
            raise AdapterError.seen(
                "mode", mode, f" of an AdaptivePolicy. {did_you_mean(mode, ADAPTIVE_MODES)}"
            )
        super().__init__(policy, f"adaptive={mode} H={policy.spec.horizon} Q={policy.spec.query_interval}")
        self._cameras = [name for name in policy.spec.cameras if _ON_THE_HAND not in name]
        self._mode = mode
        self._require_sight()
        self._budget = policy.spec.query_interval
        self._spec = replace(self.spec, horizon=1, query_interval=1)
        self.query_notes: Mapping[str, int] = {}
        self._memory = _Memory(np.zeros((0, 7)))
        self.snapshot, self.restore = self._snapshot, self._restore

    def _require_sight(self) -> None:
        name = self.inner.spec.name
        if self._mode == "image" and not self._cameras:
            raise AdapterError(
                f"adaptive='image' with policy {name!r}, which asks for no image of a fixed camera "
                f"(cameras={self.inner.spec.cameras}). Leave adaptive out of --libero-max-wrap."
            )
        if self._mode == "privileged" and not self.inner.spec.privileged:
            raise AdapterError(
                f"adaptive='privileged' with policy {name!r}, which is not privileged, so no world is handed "
                "to it. Use --libero-max-wrap=adaptive:image."
            )

    def reset(self, episode: Episode) -> None:
        self._world, self._seed = episode.world, episode.seed
        self._memory = _Memory(np.zeros((0, 7)))
        self.inner.reset(episode)

    def predict(self, observation: Observation, query: Query) -> Actions:
        memory = self._memory
        images = self._images(observation)
        changes = tuple(map(block_changes, memory.images, images))
        early = memory.asked < 1 + query.step // self._budget and self._departed(memory, changes)
        memory = replace(memory, images=images, changes=changes)
        self.query_notes = {"looks": 1, "asked": 0, "early": 0}
        if early or not len(memory.chunk):
            memory = self._ask(memory, observation, query)
            inside = getattr(self.inner, "query_notes", {})
            self.query_notes = {"looks": 1, "asked": 1, "early": int(early), **inside}
        self._memory = replace(memory, chunk=memory.chunk[1:])
        return memory.chunk[:1]

    def _images(self, observation: Observation) -> tuple[Image, ...]:
        if self._mode == "privileged":
            return ()
        return tuple(np.array(observation[f"{name}_image"]) for name in self._cameras)

    def _ask(self, memory: _Memory, observation: Observation, query: Query) -> _Memory:
        own = Query(memory.asked, query.step, query.instruction, query_seed(self._seed, memory.asked))
        chunk = ask(self.inner, observation, own)
        places = places_of(self._world) if self._mode == "privileged" and self._world is not None else None
        return replace(memory, chunk=chunk, asked=memory.asked + 1, places=places)

    def _departed(self, memory: _Memory, changes: tuple[Array, ...]) -> bool:
        """Return True if the scene no longer matches the one that the present chunk was planned for."""
        if not len(memory.chunk):
            return False
        if self._mode == "image":
            # At the first two looks there is nothing to compare with.
            pairs = zip(memory.changes, changes, strict=False)
            return any(surprise(before, now) > SURPRISE for before, now in pairs)
        assert self._world is not None
        assert memory.places is not None
        return has_moved(self._world, memory.places)

    def _snapshot(self) -> _Memory:
        inner = self.inner.snapshot() if hasattr(self.inner, "snapshot") else None
        return replace(self._memory, inner=inner)

    def _restore(self, memory: _Memory) -> None:
        if hasattr(self.inner, "restore"):
            self.inner.restore(memory.inner)
        self._memory = memory


def block_changes(before: Image, now: Image) -> Array:
    """(16, 16) grey levels: the mean absolute difference of two images within each block.

    Rows and columns that are left over are ignored.
    """
    high, wide = (side // BLOCKS for side in before.shape[:2])
    part = slice(BLOCKS * high), slice(BLOCKS * wide)
    difference = np.abs(before[part].astype(np.int16) - now[part]).mean(axis=2)
    blocks: Array = difference.reshape(BLOCKS, high, BLOCKS, wide).mean(axis=(1, 3))
    return blocks


def surprise(before: Array, now: Array) -> float:
    """Return the largest change of a block beyond that of it and its neighbours before, in grey levels.

    A steady movement, like the robot's, continues next to its last place.
    """
    wide = np.pad(before, 1, mode="edge")
    near = np.max([wide[i : i + BLOCKS, j : j + BLOCKS] for i in range(3) for j in range(3)], axis=0)
    return float((now - near).max())


def places_of(world: World) -> dict[str, Array]:
    """Position of each object, (3,) m, by name; without those taken out of the scene."""
    names = (name for name, entity in world.entities.items() if entity.kind == "object")
    return {name: np.array(world.position(name)) for name in names if name not in world.parked}


def has_moved(world: World, places: Mapping[str, Array]) -> bool:
    """Return True if an object that the robot does not touch has moved, appeared or disappeared."""
    now = places_of(world)
    if now.keys() != places.keys():
        return True
    far = (name for name, place in now.items() if float(np.linalg.norm(place - places[name])) > MOVED_M)
    return any(not {ROBOT, GRIPPER} & set(world.contacts(name)) for name in far)
