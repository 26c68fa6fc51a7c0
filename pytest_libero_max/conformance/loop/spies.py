"""An environment and a policy that keep all that a loop does with them, in one order.

Neither simulates anything. Images have one colour, which says at which step they were made whatever a loop
crops, turns or scales; actions say of which query and row they are.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pytest_libero_max.errors import ProtocolError
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import ACTION_DIM

H, Q = 8, 5
"""Chunk size and execution horizon of the spy policy."""

SIDE_PX = 64

TOO_MANY = 4
"""Number of budgets after which an episode is stopped: a loop that does not see its end goes on for ever."""

_LEVELS, _STRIDE = 12, 20
"""A channel has so many levels, so far apart that no resizing mixes them up."""

Array = NDArray[Any]


@dataclass(frozen=True)
class Script:
    """The course of an episode."""

    budget: int
    """Steps after which it is truncated."""
    success_at: int | None = None
    """Step after which the task is completed; None for never."""
    event_at: int | None = None
    """Step after which the instruction and the scene change; None for never."""
    beyond: bool = False


@dataclass(frozen=True)
class EnvironmentReset:
    """A reset of the environment."""

    seed: int | None
    at_step: int
    """Steps executed before it since the last one."""
    ended: bool
    """True if the episode before it had ended, or there was none."""


@dataclass(frozen=True)
class PolicyReset:
    """A reset of the policy."""


@dataclass(frozen=True)
class Asked:
    """A query to the policy."""

    number: int
    """Number over all episodes."""
    step: int
    """Steps that had been executed."""
    image_steps: tuple[int | None, ...]
    """Steps at which the images that it was shown were made; None for one that no step made."""
    state_step: int | None
    """Likewise for the state; None where there is none."""
    instruction: str
    current: str
    """Instruction of the environment at that time."""
    digest: bytes
    """Of all arrays that it was shown."""
    chunk: Array
    """Its answer, (H, 7)."""
    drawn: tuple[float, float]
    """A number of each global generator, as a policy draws its noise there."""


@dataclass(frozen=True)
class Executed:
    """An action that the environment was given."""

    action: Array
    ended: bool
    """True if the episode had ended before."""


Entry = EnvironmentReset | PolicyReset | Asked | Executed


@dataclass
class Spies:
    """Events of an episode, and the facts that both spies know of it."""

    script: Script
    entries: list[Entry] = field(default_factory=list)
    step: int = 0
    is_running: bool = False
    has_ended: bool = True

    @property
    def instruction(self) -> str:
        """Instruction at this time."""
        return _INSTRUCTIONS[self.has_changed]

    @property
    def has_changed(self) -> bool:
        """True after the event."""
        return self.script.event_at is not None and self.step >= self.script.event_at


_INSTRUCTIONS = ("put the bowl on the plate", "put the cup on the plate")


class SpyEnv:
    """One arm of a case, with the methods of ``gymnasium.Env`` that loops call.

    After the end it goes on with another episode, as vector environments do by themselves.
    """

    metadata: Mapping[str, Any] = {"render_modes": []}
    render_mode = None

    def __init__(self, spies: Spies) -> None:
        self._spies = spies
        self.max_steps = spies.script.budget

    @property
    def task_description(self) -> str:
        """The instruction at this time."""
        return self._spies.instruction

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin the episode."""
        spies = self._spies
        spies.entries.append(EnvironmentReset(seed, spies.step, spies.has_ended))
        spies.step, spies.is_running, spies.has_ended = 0, True, False
        return self._observed(), self._info(False)

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Keep one action, (7,)."""
        spies, array = self._spies, np.array(action, dtype=float)
        if not spies.is_running:
            raise ProtocolError("no episode is running. Call reset() first.")
        if array.shape != (ACTION_DIM,):
            raise ProtocolError(f"an action has shape {array.shape}, but must have ({ACTION_DIM},).")
        if sum(isinstance(entry, Executed) for entry in spies.entries) >= TOO_MANY * self.max_steps:
            raise ProtocolError("the loop goes on after the end of the episode.")
        spies.entries.append(Executed(array, spies.has_ended))
        if spies.has_ended:
            return self._observed(), 0.0, False, False, self._info(False)
        spies.step += 1
        success = spies.step == spies.script.success_at
        truncated = spies.step >= self.max_steps and not success
        spies.has_ended = success or truncated
        return self._observed(), float(success), success, truncated, self._info(success)

    def render(self) -> Array:
        """Return the scene's image."""
        return _image(self._spies.step, self._spies.has_changed)

    def close(self) -> None:
        """Do nothing."""

    def _info(self, success: bool) -> dict[str, Any]:
        return {"step": self._spies.step, "instruction": self.task_description, "is_success": success}

    def _observed(self) -> Observation:
        step, changed = self._spies.step, self._spies.has_changed
        return {
            "agentview_image": _image(step, changed),
            "robot0_eye_in_hand_image": _image(step, changed),
            "robot0_eef_pos": np.array([step / 100, 0.1, 0.9]),
            "robot0_eef_quat": np.array([1.0, 0.0, 0.0, 0.0]),
            "robot0_gripper_qpos": np.array([0.04, -0.04]),
            "robot0_gripper_qvel": np.zeros(2),
            "robot0_joint_pos": np.zeros(7),
            "robot0_joint_vel": np.zeros(7),
        }


class SpyPolicy:
    """A policy whose answers name their query."""

    horizon, query_interval = H, Q

    def __init__(self) -> None:
        self._count = 0
        self._queue: deque[Array] = deque()
        self._shown: dict[int, tuple[list[Array], bytes]] = {}
        self.images_written: set[int] = set()  # numbers of the queries whose arrays were written to later
        self.spies: Spies | None = None

    def reset(self) -> None:
        """Forget the queue: a new episode begins."""
        self._queue.clear()
        self._now.entries.append(PolicyReset())

    def predict(self, observation: Mapping[str, Any], instruction: str = "") -> Array:
        """Return the (H, 7) actions of a query."""
        spies, arrays = self._now, list(_arrays(observation))
        chunk = _chunk(self._count, spies.script.beyond)
        images = [array for array in arrays if _is_image(array)]
        self._look_back()
        self._shown[self._count] = arrays, _bytes(arrays)
        spies.entries.append(
            Asked(
                self._count,
                spies.step,
                tuple(map(_step_of_image, images)),
                _step_of_state(observation),
                instruction or _text_in(observation),
                spies.instruction,
                _bytes(arrays),
                chunk,
                (random.random(), float(np.random.random())),  # noqa: NPY002 - as policies do
            )
        )
        self._count += 1
        return chunk.copy()

    def act(self, observation: Mapping[str, Any], instruction: str = "") -> Array:
        """Return the next (7,) action: of the last answer until Q of it were returned, then of a new one."""
        if not self._queue:
            self._queue.extend(self.predict(observation, instruction)[:Q])
        return self._queue.popleft()

    @property
    def _now(self) -> Spies:
        assert self.spies is not None
        return self.spies

    def _look_back(self) -> None:
        """Note which arrays of earlier queries are not what they were."""
        self.images_written |= {
            number for number, (arrays, digest) in self._shown.items() if _bytes(arrays) != digest
        }


def _image(step: int, changed: bool) -> Array:
    levels = (step % _LEVELS, step // _LEVELS, 3 * changed)
    colour = [_STRIDE * level + _STRIDE // 2 for level in levels]
    return np.full((SIDE_PX, SIDE_PX, 3), colour, dtype=np.uint8)


def _step_of_image(image: Array) -> int | None:
    """Return the step at which an image was made; None where it is none of an environment's.

    Its colours may be numbers up to 1, and its channels may stand first.
    """
    pixels = np.asarray(image, dtype=float)
    pixels = pixels if pixels.shape[-1] == 3 else np.moveaxis(pixels, -3, -1)
    colour = np.median(pixels.reshape(-1, 3), axis=0) * (255 if pixels.max() <= 1 else 1)
    levels = (colour - _STRIDE // 2) / _STRIDE
    if np.abs(levels - levels.round()).max() > 0.4 or levels.round().min() < 0:
        return None
    return int(levels[0].round() + _LEVELS * levels[1].round())


def _is_image(array: Array) -> bool:
    return array.ndim >= 3 and (array.shape[-1] == 3 or array.shape[-3] == 3)


def _step_of_state(observation: Mapping[str, Any]) -> int | None:
    """Return the step of a state, whose first number is the hand's position; None where there is none."""
    for key, value in observation.items():
        array = np.asarray(value) if "state" in str(key) or str(key) == "robot0_eef_pos" else None
        if array is not None and array.dtype.kind == "f" and array.size >= 3:
            return round(float(array.reshape(-1)[0]) * 100)
    return None


def _arrays(value: Any) -> Iterator[Array]:
    if isinstance(value, Mapping):
        for _, item in sorted(value.items(), key=lambda entry: str(entry[0])):
            yield from _arrays(item)
    elif isinstance(value, list | tuple) and value and not isinstance(value[0], int | float | str):
        for item in value:
            yield from _arrays(item)
    elif hasattr(value, "__array__"):
        yield np.asarray(value)


def _text_in(observation: Mapping[str, Any]) -> str:
    """Return the instruction of an observation that holds it, for loops that send one map."""
    return next((value for value in observation.values() if isinstance(value, str)), "")


def _bytes(arrays: list[Array]) -> bytes:
    return b"".join(array.tobytes() for array in arrays)


def _chunk(number: int, beyond: bool) -> Array:
    """Return the (H, 7) answer to a query: its number in the first two columns, the row in the third."""
    chunk = np.zeros((H, ACTION_DIM))
    chunk[:, 0], chunk[:, 1] = (number % 16 + 1) / 20, (number // 16) / 20  # no row is a waiting step
    chunk[:, 2] = np.arange(H) / 20
    chunk[:, 3] = 1.5 if beyond else 0.5
    chunk[:, 6] = np.where(np.arange(H) % 2, 1.0, -1.0)
    return chunk
