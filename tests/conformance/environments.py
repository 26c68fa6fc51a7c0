"""Environments with one mistake each, over a floating hand that turns, for the rules of environments."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np
from msgspec import structs

from pytest_libero_max.conformance.environment.declared import DeclaredEnvironment
from pytest_libero_max.conformance.environment.reference import TaskReference, record
from pytest_libero_max.policies.transforms.states import axis_angle, axis_angle_antipodal
from pytest_libero_max.substrates.tiny.world import INITS, TinyWorld
from pytest_libero_max.worlds.contract import Array, Image
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION
from pytest_libero_max.worlds.rotations import about, multiply

_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_TURN_RAD = 0.1
"""Turn of the hand under an action of 1."""
BUDGET = 80
"""Steps of an episode: little more than the task takes."""


class TurningWorld(TinyWorld):
    """The tiny world with a hand that turns, which no picture shows, and another place for each start."""

    turn = (0.0, 1.0, 0.0, 0.0)

    def _reset_controller(self) -> None:
        super()._reset_controller()
        self.turn = (0.0, 1.0, 0.0, 0.0)

    def _initial_qpos(self, init: int) -> Array:
        qpos = super()._initial_qpos(init)
        qpos[self._hand[0]] += 0.01 * init
        return qpos

    def _control_step(self, action: Array) -> bool:
        for axis, value in zip(_AXES, action[3:6], strict=True):
            self.turn = multiply(about(axis, _TURN_RAD * float(np.clip(value, -1.0, 1.0))), self.turn)
        return super()._control_step(action)

    def _proprioception(self) -> dict[str, Array]:
        return super()._proprioception() | {"robot0_eef_quat": np.roll(self.turn, -1)}


def _solving(world: TinyWorld, init: int) -> list[list[float]]:
    """Return the actions that take the box to the plate."""
    world.reset(init)
    for _ in range(10):
        world.step(NOOP_ACTION)
    box, plate = world.position("box_1"), world.position("plate_1")
    over, down = np.array([0.0, 0.0, 0.12]), np.array([0.0, 0.0, -0.02])
    places = [(box + over, -1), (box + down, -1), (box + down, 1), (box + over, 1), (plate + over, 1)]
    places += [(plate + np.array([0.0, 0.0, 0.03]), 1), (plate + np.array([0.0, 0.0, 0.03]), -1)]
    actions: list[list[float]] = []
    for place, fingers in places:
        for _ in range(10):
            move = np.clip((place - world.end_effector()) / 0.05, -1.0, 1.0)
            actions.append([*move.tolist(), 0.2, 0.0, 0.0, float(fingers)])
            world.step(actions[-1])
    return actions


@cache
def reference() -> TaskReference:
    """Return what the world does."""
    world = TurningWorld()
    actions = _solving(world, 1)
    try:
        recorded = record(world, actions, task="libero_spatial/0", init=1, versions={"substrate": "tiny"})
        return structs.replace(recorded, budget=BUDGET)
    finally:
        world.close()


@cache
def _picture(camera: str) -> Image:
    return np.kron(reference().picture(camera), np.ones((2, 2, 1))).astype(np.uint8)


class LiberoShaped:
    """An environment like LIBERO's own: reset, set_init_state, and steps of four values. It is sound."""

    world_class: type[TinyWorld] = TurningWorld
    clockwork = True
    """True if its simulator can be found."""

    def __init__(self) -> None:
        self.world: TinyWorld = self.world_class()
        self.closed = 0

    @property
    def sim(self) -> Any:
        return SimpleNamespace(data=self.world.data, model=self.world.model) if self.clockwork else None

    def seed(self, seed: int) -> None:
        """Seed nothing: the world draws nothing."""

    def reset(self) -> dict[str, Any]:
        self.world.reset(0)
        return self.observation()

    def set_init_state(self, state: Any) -> dict[str, Any]:
        self.world.reset(int(state))
        return self.observation()

    def observation(self) -> dict[str, Any]:
        images = {f"{camera}_image": self.image(camera) for camera in CAMERAS}
        return {**self.world.observe(()), **images}

    def image(self, camera: str) -> Image:
        """(64, 64, 3): the reference's picture with a line of the state; a renderer takes much longer."""
        image = _picture(camera).copy()
        values = np.concatenate([self.world.end_effector(), *map(self.world.position, ("box_1", "plate_1"))])
        image[:2] = np.resize((1e4 * values).astype(np.int64) % 256, image[:2].shape)
        return image

    def step(self, action: Any) -> tuple[Any, ...]:
        self.world.step(self.action(np.asarray(action)))
        done = self.succeeded()
        return self.observation(), float(done), done, {}

    def action(self, action: Array) -> Array:
        """Return the action that the world plays."""
        return action

    def succeeded(self) -> bool:
        return self.world.succeeded()

    def close(self) -> None:
        self.world.close()


def declared(environment: type[LiberoShaped], **fields: Any) -> DeclaredEnvironment:
    """Return an environment of the reference's task."""
    states = None if "begin" in fields else range(INITS)
    return DeclaredEnvironment(environment, reference=reference(), initial_states=states, **fields)


class Drawn(LiberoShaped):
    """Draws its images. It is sound."""

    def image(self, camera: str) -> Image:
        return cast(Image, self.world.observe((camera,), 64)[f"{camera}_image"])


class Gym(LiberoShaped):
    """A sound Gymnasium environment that settles by itself, with nested observations and a state vector."""

    settle_steps = 10
    max_episode_steps = BUDGET
    set_init_state = None  # type: ignore[assignment]
    task_description = "put the box on the plate"

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Any:
        self.world.reset(self.initial_state(int((options or {}).get("init", 1))))
        for _ in range(self.settle_steps):
            self.world.step(NOOP_ACTION)
        return self.observation(), {}

    def initial_state(self, init: int) -> int:
        return init

    def observation(self) -> dict[str, Any]:
        flat = super().observation()
        images = {"image": flat["agentview_image"], "image2": flat["robot0_eye_in_hand_image"]}
        eef = {"pos": flat["robot0_eef_pos"], "quat": flat["robot0_eef_quat"]}
        state = np.concatenate([eef["pos"], self.rotation(eef["quat"]), flat["robot0_gripper_qpos"]])
        robot = {"eef": eef, "gripper": {"qpos": flat["robot0_gripper_qpos"]}}
        return {"pixels": images, "robot_state": robot, "state": state}

    def rotation(self, quaternion: Array) -> Array:
        return axis_angle(quaternion)

    def step(self, action: Any) -> tuple[Any, ...]:
        observation, reward, done, _ = super().step(action)
        return observation, reward, done, False, {"is_success": done}


class Vector(Gym):
    """Two of them at once, as Gymnasium's vector environments return them."""

    num_envs = 2

    def reset(self, **options: Any) -> Any:  # type: ignore[override]
        observation, info = super().reset(**options)
        return _twice(observation), info

    def step(self, action: Any) -> tuple[Any, ...]:
        observation, reward, done, truncated, info = super().step(action[0])
        twice = (np.array([value, value]) for value in (reward, done, truncated))
        return _twice(observation), *twice, {"is_success": np.array([info["is_success"]] * 2)}


def _twice(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _twice(inner) for key, inner in value.items()}
    return np.stack([value, value])


def from_options(environment: Any, init: int) -> Any:
    """Begin a Gymnasium environment from an initial state."""
    return environment.reset(seed=0, options={"init": init})


class WithoutWrist(LiberoShaped):
    def observation(self) -> dict[str, Any]:
        return {key: value for key, value in super().observation().items() if "eye_in_hand_image" not in key}


def delivering(name: str, change: Callable[[Any], Any]) -> type[LiberoShaped]:
    """Return an environment whose images are changed."""

    def observation(self: LiberoShaped) -> dict[str, Any]:
        flat = LiberoShaped.observation(self)
        return {key: change(value) if key.endswith("_image") else value for key, value in flat.items()}

    return type(name, (LiberoShaped,), {"observation": observation})


FloatImages = delivering("FloatImages", lambda image: image / 255.0)
Upright = delivering("Upright", lambda image: image[::-1])
Mirrored = delivering("Mirrored", lambda image: image[:, ::-1])
Rotated = delivering("Rotated", lambda image: image[::-1, ::-1])
Bgr = delivering("Bgr", lambda image: image[..., ::-1])
Dark = delivering("Dark", lambda image: image // 2)


def scaling(name: str, *factors: float) -> type[LiberoShaped]:
    """Return an environment that plays actions times (7,) factors."""
    return type(name, (LiberoShaped,), {"action": lambda self, action: action * np.array(factors)})


Half = scaling("Half", 0.5, 0.5, 0.5, 1, 1, 1, 1)
OtherGains = scaling("OtherGains", 1.1, 1.1, 1.1, 1, 1, 1, 1)
TurningBack = scaling("TurningBack", 1, 1, 1, 1, 1, -1, 1)
ClosingAtMinusOne = scaling("ClosingAtMinusOne", 1, 1, 1, 1, 1, 1, -1)


def giving(name: str, key: str, change: Callable[[Any], Any]) -> type[LiberoShaped]:
    """Return an environment one value of whose observations is changed."""

    def observation(self: LiberoShaped) -> dict[str, Any]:
        flat = LiberoShaped.observation(self)
        return flat | {key: change(flat[key])}

    return type(name, (LiberoShaped,), {"observation": observation})


WFirst = giving("WFirst", "robot0_eef_quat", lambda quaternion: np.roll(quaternion, 1))
Width = giving("Width", "robot0_gripper_qpos", np.abs)  # the opening in place of the joints

Swapped = type("Swapped", (LiberoShaped,), {"action": lambda self, action: action[[1, 0, 2, 3, 4, 5, 6]]})
Antipodal = type("Antipodal", (Gym,), {"rotation": lambda self, quaternion: axis_angle_antipodal(quaternion)})
Settling = type("Settling", (Gym,), {"settle_steps": 5})
"""Plays five settle steps of the ten that it declares."""
LongEpisodes = type("LongEpisodes", (Gym,), {"max_episode_steps": BUDGET + 60})
FromTheFileName = type(
    "FromTheFileName", (Gym,), {"task_description": "put the box on the plate view 0 0 100"}
)


class ThreeValues(LiberoShaped):
    def step(self, action: Any) -> tuple[Any, ...]:
        return super().step(action)[:3]


class OneBuffer(LiberoShaped):
    """Writes each observation into the same arrays."""

    buffer: dict[str, Any] | None = None

    def observation(self) -> dict[str, Any]:
        new = super().observation()
        if self.buffer is None:
            self.buffer = new
        for key, value in new.items():
            self.buffer[key][...] = value
        return self.buffer


class ClosedOnce(LiberoShaped):
    def close(self) -> None:
        super().close()
        del self.world


class OffByOne(LiberoShaped):
    """Begins from the next initial state."""

    def set_init_state(self, state: Any) -> dict[str, Any]:
        return super().set_init_state((int(state) + 1) % INITS)


class Remembering(LiberoShaped):
    """Begins elsewhere after an episode from another initial state."""

    last: int | None = None

    def set_init_state(self, state: Any) -> dict[str, Any]:
        moved = self.last is not None and self.last != int(state)
        self.last = int(state)
        observation = super().set_init_state(state)
        if moved:
            address = self.world.model.joint("box_1_joint0").qposadr[0]
            self.world.data.qpos[address : address + 2] += 0.03
            mujoco.mj_forward(self.world.model, self.world.data)
            return self.observation()
        return observation


class Counting(Gym):
    """Chooses its initial state by the count of resets, where none is named."""

    resets = 0

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> Any:
        self.resets += 1
        return super().reset(seed, options or {"init": self.resets % INITS})


class Unseeded(LiberoShaped):
    """Puts the cabinet in another place at each reset."""

    resets = 0

    def set_init_state(self, state: Any) -> dict[str, Any]:
        observation = super().set_init_state(state)
        self.resets += 1
        self.world.model.body("cabinet_1_main").pos[1] = 0.002 * self.resets
        return observation


class Stale(LiberoShaped):
    """Returns every image twice."""

    drawn: dict[str, Any] | None = None

    def set_init_state(self, state: Any) -> dict[str, Any]:
        self.drawn = None
        return super().set_init_state(state)

    def observation(self) -> dict[str, Any]:
        new = super().observation()
        if self.drawn is not None:
            old, self.drawn = self.drawn, None
            return new | old
        self.drawn = {key: value for key, value in new.items() if key.endswith("_image")}
        return new


class SharedImages(LiberoShaped):
    """Draws what the environment opened last shows."""

    opened: list[LiberoShaped] = []  # noqa: RUF012  - that is the mistake

    def __init__(self) -> None:
        super().__init__()
        self.opened.append(self)

    def image(self, camera: str) -> Image:
        return LiberoShaped.image(self.opened[-1], camera)

    def close(self) -> None:
        if self in self.opened:
            self.opened.remove(self)
        super().close()


class TwiceAsFast(LiberoShaped):
    def step(self, action: Any) -> tuple[Any, ...]:
        super().step(action)
        return super().step(action)


class ShortEpisodes(LiberoShaped):
    """Ends an episode before its budget, settle steps among them."""

    steps = 0

    def set_init_state(self, state: Any) -> dict[str, Any]:
        self.steps = 0
        return super().set_init_state(state)

    def step(self, action: Any) -> tuple[Any, ...]:
        self.steps += 1
        observation, reward, done, _ = super().step(action)
        return observation, reward, done or self.steps >= BUDGET + 6, {"success": done}


class Absolute(Gym):
    """Takes actions for poses, once it has settled."""

    def action(self, action: Array) -> Array:
        return np.array([*(10.0 * (action[:3] - self.world.end_effector())), *action[3:]])


class UnboundedWorld(TurningWorld):
    """Moves as far as an action says."""

    def _control_step(self, action: Array) -> bool:
        for _ in range(int(np.abs(action[:3]).max()) // 2):
            super()._control_step(action)
        return super()._control_step(action)


class Unbounded(LiberoShaped):
    world_class = UnboundedWorld
    clockwork = False  # its clock would say that it plays several steps


class NeverDone(LiberoShaped):
    def succeeded(self) -> bool:
        return False


class Easy(LiberoShaped):
    """Is content when the box is held over the plate."""

    def succeeded(self) -> bool:
        apart = self.world.position("box_1")[:2] - self.world.position("plate_1")[:2]
        return float(np.linalg.norm(apart)) < 0.1


class Noisy(LiberoShaped):
    """Adds noise to the hand's position."""

    def __init__(self) -> None:
        super().__init__()
        self.generator = np.random.default_rng(0)

    def observation(self) -> dict[str, Any]:
        flat = super().observation()
        return flat | {"robot0_eef_pos": flat["robot0_eef_pos"] + self.generator.normal(0.0, 1e-6, 3)}


class Aging(LiberoShaped):
    """Moves a little less with each environment that was opened before it."""

    opened = 0

    def __init__(self) -> None:
        super().__init__()
        type(self).opened += 1
        self.age = type(self).opened

    def set_init_state(self, state: Any) -> dict[str, Any]:
        observation = super().set_init_state(state)
        return observation | {"robot0_eef_pos": observation["robot0_eef_pos"] + 1e-6 * self.age}

    def step(self, action: Any) -> tuple[Any, ...]:
        observation, *rest = super().step(action)
        return observation | {"robot0_eef_pos": observation["robot0_eef_pos"] + 1e-6 * self.age}, *rest


class Hashed(LiberoShaped):
    """Begins elsewhere in a process with other hashes."""

    def observation(self) -> dict[str, Any]:
        flat = super().observation()
        return flat | {"robot0_eef_pos": flat["robot0_eef_pos"] + 1e-9 * (hash("hand") / sys.maxsize)}


def by_hash() -> DeclaredEnvironment:
    """Declare an environment that another process opens by its name."""
    return declared(Hashed)


def plain(task_id: int = 0) -> LiberoShaped:
    """Return an environment as it is, which declares nothing."""
    environment = LiberoShaped()
    environment.task_id = task_id  # type: ignore[attr-defined]
    return environment
