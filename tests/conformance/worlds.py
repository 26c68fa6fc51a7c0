"""Tiny worlds with one mistake each, for the rules of substrates."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.substrates.tiny.world import INITS, TinyWorld
from pytest_libero_max.worlds.contract import Array, ImageSize, WorldState
from pytest_libero_max.worlds.robot import Robot
from pytest_libero_max.worlds.scenery import Lights


class OneWorld:
    """A substrate of one world."""

    name = "tiny"

    def __init__(self, world: TinyWorld) -> None:
        self.only = world

    def world(self, case: Case) -> TinyWorld:
        return self.only

    def fingerprint(self, images: bool = False) -> Mapping[str, str]:
        return {}

    def close(self) -> None:
        self.only.close()


class AcceptingAnything(TinyWorld):
    def step(self, action: Sequence[float] | Array) -> None:
        whole = np.zeros(7)
        whole[: len(action)] = action
        super().step(np.nan_to_num(whole, posinf=0.0))


class WrappingInits(TinyWorld):
    def reset(self, init: int) -> None:
        super().reset(init % INITS)


class TwiceAsFast(TinyWorld):
    def step(self, action: Sequence[float] | Array) -> None:
        super().step(action)
        super().step(action)


def scaling(name: str, *factors: float) -> type[TinyWorld]:
    """Return a world that plays actions times (7,) factors."""

    def step(self: TinyWorld, action: Sequence[float] | Array) -> None:
        TinyWorld.step(self, np.asarray(action, dtype=float) * factors if len(action) == 7 else action)

    return type(name, (TinyWorld,), {"step": step})


Mirrored = scaling("Mirrored", 1, -1, 1, 1, 1, 1, 1)
ClosingAtMinusOne = scaling("ClosingAtMinusOne", 1, 1, 1, 1, 1, 1, -1)


class OpeningAtPlusOne(TinyWorld):
    """Its robot says so: no mistake."""

    step = ClosingAtMinusOne.step

    @property
    def robot(self) -> Robot:
        return replace(super().robot, noop=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))


class Growing(TinyWorld):
    """Moves a little less after each reset."""

    resets = 0

    def reset(self, init: int) -> None:
        self.resets += 1
        super().reset(init)

    def _control_step(self, action: Array) -> bool:
        return super()._control_step(action * (1.0 - 1e-6 * self.resets))


class FromTheLast(TinyWorld):
    """Counts initial states on from the last one."""

    last = 0

    def reset(self, init: int) -> None:
        if 0 <= init < INITS:
            init, self.last = (init + self.last) % INITS, init
        super().reset(init)


class Drifting(TinyWorld):
    """Moves with what no snapshot holds."""

    drift = 0

    def reset(self, init: int) -> None:
        self.drift = 0
        super().reset(init)

    def _control_step(self, action: Array) -> bool:
        self.drift += 1
        return super()._control_step(action + np.array([1e-6 * self.drift, 0, 0, 0, 0, 0, 0]))


class Aliasing(TinyWorld):
    """A snapshot shares the controller's state with the live world."""

    live = np.zeros(1)

    def snapshot(self) -> WorldState:
        state = super().snapshot()
        self.live = np.array(state.controller)
        return replace(state, controller=self.live)

    def _control_step(self, action: Array) -> bool:
        self.live += 1.0
        return super()._control_step(action)


class PositionsAlone(TinyWorld):
    """Digests positions and velocities, not the whole state."""

    def digest(self) -> bytes:
        return hashlib.sha256(self.data.qpos.tobytes() + self.data.qvel.tobytes()).digest()


class LettingWritesBe(TinyWorld):
    def take_back_writes(self) -> tuple[str, ...]:
        return ()


class Done(TinyWorld):
    def succeeded(self) -> bool:
        return True


def observing(name: str, change: Callable[[str, Any], tuple[str, Any]]) -> type[TinyWorld]:
    """Return a world whose observations are changed, key by key."""

    def observe(
        self: TinyWorld, cameras: Sequence[str] | None = None, size: ImageSize = 256
    ) -> dict[str, NDArray[Any]]:
        return dict(change(key, value) for key, value in TinyWorld.observe(self, cameras, size).items())

    return type(name, (TinyWorld,), {"observe": observe})


Renamed = observing("Renamed", lambda key, value: (key.replace("robot0_eef", "eef"), value))
Upright = observing("Upright", lambda key, value: (key, value[::-1] if key[-6:] == "_image" else value))
Rotated = observing("Rotated", lambda key, value: (key, value[::-1, ::-1] if key[-6:] == "_image" else value))


class Flickering(TinyWorld):
    """Draws its images with a generator of its own."""

    def __init__(self) -> None:
        self.generator = np.random.default_rng(0)
        super().__init__()

    def observe(self, cameras: Sequence[str] | None = None, size: ImageSize = 256) -> dict[str, NDArray[Any]]:
        observation = super().observe(cameras, size)
        for camera in cameras or ():
            observation[f"{camera}_image"][0, 0] = self.generator.integers(0, 256, 3)
        return observation


class StirringWhenDrawn(TinyWorld):
    def observe(self, cameras: Sequence[str] | None = None, size: ImageSize = 256) -> dict[str, NDArray[Any]]:
        observation = super().observe(cameras, size)
        if cameras:
            self.data.qvel[-1] += 1e-9
        return observation


class Jostling(TinyWorld):
    """Whatever is placed shakes the plate."""

    def place(self, entity: str, *where: Any) -> None:
        super().place(entity, *where)
        if entity == "box_1":
            position, orientation = self.pose("plate_1")
            super().place("plate_1", position + np.array([0.001, 0, 0]), orientation)


class Shaking(TinyWorld):
    """A change of light moves the hand."""

    def set_lights(self, lights: Lights) -> None:
        super().set_lights(lights)
        self.data.qvel[0] += 1e-9
