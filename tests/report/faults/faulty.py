"""The expert, made to fail in one known way after the event, or from the first step on."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.experts.expert import ExpertPolicy, plan, subgoals
from pytest_libero_max.experts.motion import follow
from pytest_libero_max.experts.scene_view import owner_of, read_hand
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.privileged import Fact
from pytest_libero_max.worlds.robot import NOOP_ACTION

Array = NDArray[np.float64]

_JUMP_M = 0.04  # way of an object between two queries that only a change makes
_HAND_M = 0.2  # an object nearer to the hand than this may be moved by it


@dataclass(frozen=True)
class Fault:
    """A way to fail, with the causes that are right for it.

    Attributes:
        name: Name in the table.
        act: The actions of a broken policy for a query.
        accepted: Causes that are right. Where it depends on the episode, ``act`` notes others in the policy's
            memory under ``truth``.
        tasks: Suite and index of the tasks in which it can happen.
        events: Events after which it is tried.
    """

    name: str
    act: Callable[[Faulty, Query], Array]
    accepted: frozenset[str]
    tasks: tuple[tuple[str, int], ...]
    events: tuple[str, ...] = ("illumination_switch", "camera_shift", "obstacle_insertion")


class Faulty(ExpertPolicy):
    """The expert that goes wrong in the way of a fault once the world has changed.

    Args:
        fault: The fault.
        seed: Varies where and when it goes wrong.
        always: True if it is broken from the first step on, so that Base fails as well.
    """

    def __init__(self, fault: Fault, seed: int = 0, always: bool = False) -> None:
        self.spec = replace(ExpertPolicy.spec, name=f"faulty-{fault.name}", cameras=())
        self.fault, self.seed, self.always = fault, seed, always
        self.memory: dict[str, Any] = {}

    def reset(self, episode: Episode) -> None:
        """Begin anew; what is drawn depends on fault, seed and episode alone."""
        super().reset(episode)
        self.world: Any = self._world
        self.max_steps = episode.max_steps
        self.memory = {"broken": self.always}
        self._draws = [zlib.crc32(self.fault.name.encode()), self.seed, episode.seed]

    def snapshot(self) -> object:
        """Return a copy of what later answers depend on."""
        return copy.deepcopy(self.memory)

    def restore(self, memory: object) -> None:
        """Take a copy back."""
        self.memory = copy.deepcopy(dict(memory))  # type: ignore[call-overload]

    def predict(self, observation: Observation, query: Query) -> Array:
        """Return the expert's actions, or those of the fault once the world has changed."""
        memory = self.memory
        if not memory["broken"]:
            memory["broken"] = self._has_changed()
        if "start" not in memory:
            memory["start"] = {name: self.world.position(name).copy() for name in self._objects()}
        if memory["broken"]:
            memory.setdefault("event", query.step)
            return np.array(self.fault.act(self, query))
        return self.expert()

    def _objects(self) -> list[str]:
        world = self.world
        parked = set(world.parked)
        return [n for n, entity in world.entities.items() if entity.kind == "object" and n not in parked]

    def _has_changed(self) -> bool:
        model = self.world.model
        looks = (
            model.light_diffuse,
            model.cam_pos,
            model.cam_quat,
            model.geom_rgba,
            model.mat_rgba,
            model.tex_data[::997],
        )
        now = (
            tuple(zlib.crc32(np.ascontiguousarray(values).tobytes()) for values in looks),
            tuple(self._objects()),
        )
        places = {name: self.world.position(name).copy() for name in self._objects()}
        was, before = self.memory.get("looks", now), self.memory.get("places", places)
        hand = self.hand
        jumps = [
            name
            for name in places.keys() & before.keys()
            if np.linalg.norm(places[name] - before[name]) > _JUMP_M
            and np.linalg.norm(places[name] - hand) > _HAND_M / 2
        ]
        for name in jumps:
            self.memory.setdefault("old", {})[name] = before[name]
        self.memory["looks"], self.memory["places"] = now, places
        return was != now or bool(jumps)

    # What faults are made of.

    @property
    def hand(self) -> Array:
        """(3,) m."""
        return np.array(self.world.end_effector())

    @property
    def left(self) -> list[Fact]:
        """Subgoals that are left."""
        return subgoals(self.world)

    @property
    def target(self) -> str:
        """The object of the task that is next, kept from the first query of the broken policy on."""
        if "target" not in self.memory:
            facts = [fact for fact in self.left if fact.place is not None] or list(self.world.goal)
            self.memory["target"] = owner_of(self.world, facts[0].subject)
        return str(self.memory["target"])

    def at(self, name: str) -> Array:
        """Position of an object, (3,) m."""
        return np.array(self.world.position(name))

    def held(self, name: str | None = None) -> bool:
        """Return True if both fingers touch an object: the target."""
        return bool(self.world.fingers_on(name or self.target) == 2)

    def lifted_m(self) -> float:
        """Height of the held target above where it was at the start, m; 0 where it is not held."""
        if not self.held():
            return 0.0
        return float(self.at(self.target)[2] - self.memory["start"].get(self.target, self.at(self.target))[2])

    def goal_m(self) -> float:
        """Horizontal distance of the target from its destination, m."""
        return float(np.linalg.norm((self.at(self.target) - self.place())[:2]))

    def place(self) -> Array:
        """Where the target belongs, (3,) m."""
        fact = next(fact for fact in self.world.goal if fact.subject == self.target)
        if fact.place in self.world.entities:
            return self.at(str(fact.place))
        return np.array(self.world.data.site(fact.place).xpos)

    def draw(self, name: str, low: float, high: float) -> float:
        """Return a number that is drawn once an episode."""
        drawn = np.random.default_rng([*self._draws, zlib.crc32(name.encode())])
        return float(drawn.uniform(low, high))

    def aside(self, name: str, low: float, high: float) -> Array:
        """Return a horizontal vector, (3,) m, in a direction that is drawn once an episode."""
        angle = self.draw(f"{name} angle", 0, 2 * np.pi)
        return self.draw(name, low, high) * np.array([np.cos(angle), np.sin(angle), 0.0])

    def expert(self, beside: Sequence[float] | Array = (0.0, 0.0, 0.0), **told: Any) -> Array:
        """Return the expert's actions, of a hand that it takes to be ``beside`` where it is."""
        hand = read_hand(self._world)
        hand = replace(hand, position=hand.position + np.asarray(beside))
        world: Any = Told(self._world, told) if told else self._world
        actions, _ = follow(hand, plan(world, hand), self.spec.horizon)
        return np.array(actions)

    def expert_to(self, off: Array) -> Array:
        """Return the actions of an expert that takes the destination of the target to be ``off`` from it."""
        fact = next(fact for fact in self.world.goal if fact.subject == self.target)
        place = str(fact.place)
        if place in self.world.entities:
            shift = lambda name: self.world.position(name) + (off if name == place else 0.0)  # noqa: E731
            return self.expert(position=shift)
        data = self.world.data

        def site(name: Any) -> Any:
            real = data.site(name)
            if name != place:
                return real
            return Told(real, {"xpos": np.array(real.xpos) + off})

        return self.expert(data=Told(data, {"site": site}))

    def still(self, grip: float = -1.0) -> Array:
        """Return actions that do nothing."""
        return np.tile([*NOOP_ACTION[:6], grip], (self.spec.horizon, 1))

    def towards(self, place: Any, grip: float = -1.0, speed: float = 1.0) -> Array:
        """Return actions straight to a place."""
        way = np.clip(20 * (np.asarray(place) - self.hand), -speed, speed)
        return np.tile([*way, 0.0, 0.0, 0.0, grip], (self.spec.horizon, 1))

    def since(self, name: str, query: Query) -> int:
        """Return the steps since this was first asked."""
        return int(query.step - self.memory.setdefault(f"since {name}", query.step))

    def truth(self, *causes: str) -> None:
        """Note the causes that are right for this episode."""
        self.memory["truth"] = frozenset(causes)


@dataclass(frozen=True)
class Told:
    """A world that tells something else than it is."""

    inner: Any
    told: Mapping[str, Any] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        return self.told[name] if name in self.told else getattr(self.inner, name)


def grip(actions: Array, command: float) -> Array:
    """Return actions with another command to the gripper."""
    actions = np.array(actions)
    actions[:, 6] = command
    return actions
