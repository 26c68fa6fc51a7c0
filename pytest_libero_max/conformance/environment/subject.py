"""An environment of others as the subject of rules: episodes begun, actions played, simulator looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.conformance.environment.declared import DeclaredEnvironment, FactoryName
from pytest_libero_max.conformance.environment.reference import TaskReference, turn_between
from pytest_libero_max.conformance.rules import Measurements
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION

T = TypeVar("T")
Array = NDArray[np.float64]

_LEVELS = 5
"""Most wrappers around a simulator."""


class Played(NamedTuple):
    """Result of a step."""

    reading: Reading
    reward: Any
    done: bool
    truncated: bool
    """True if it ended at a limit of steps; False where the environment cannot say so."""
    success: bool
    fields: int
    """Length of the tuple."""


@dataclass
class EnvironmentSubject(Measurements):
    """An environment that is declared; it is opened when a rule first needs it."""

    declared: DeclaredEnvironment
    name: str = ""
    """Name by which another process opens it; empty where it is an object of this one."""
    _opened: Any = field(init=False, default=None, repr=False)

    @cached_property
    def reference(self) -> TaskReference:
        """Recording of genuine LIBERO in the task."""
        return self.declared.expects()

    @property
    def environment(self) -> Any:
        """The environment; opened on first use."""
        if self._opened is None:
            self._opened = called("the factory", self.declared.make)
        return self._opened

    def another(self) -> EnvironmentSubject:
        """Return the same environment opened once more, beside this one."""
        return EnvironmentSubject(self.declared, self.name)

    def close(self) -> None:
        """Close the environment; the next rule opens another one."""
        environment, self._opened = self._opened, None
        if environment is not None and hasattr(environment, "close"):
            called("close()", environment.close)

    def abandon(self) -> None:
        """Close the environment, whatever happens."""
        with suppress(SubstrateError):
            self.close()

    @cached_property
    def is_vector(self) -> bool:
        """True for a vector of environments."""
        return getattr(self.environment, "num_envs", None) is not None

    def start(self, init: int | None = None) -> Reading:
        """Begin an episode as the environment does it, and return its first observation."""
        init = self.reference.init if init is None else init
        self.draw(True)
        return self._read(called("beginning an episode", self._begin, init))

    def begin(self, init: int | None = None, *, drawn: bool = False) -> Reading:
        """Begin an episode, and play the settle steps that the environment leaves to others.

        The observation and those that follow have their images where they are to be ``drawn``.
        """
        reading = self.start(init)
        steps = self.reference.settle_steps - self.declared.settle_steps
        self.draw(drawn and steps <= 0)
        for left in range(steps, 0, -1):
            self.draw(drawn and left == 1)
            reading = self.step(NOOP_ACTION).reading
        return reading

    def draw(self, on: bool) -> None:
        """Switch the drawing of images on or off, where that can be."""
        if self.declared.drawing is not None:
            called("drawing=", self.declared.drawing, self.environment, on)

    def restart(self, seed: int) -> Reading:
        """Begin an episode by ``reset(seed=...)`` alone, whatever is declared."""
        return self._read(called("reset()", lambda: self.environment.reset(seed=seed)))

    @property
    def chooses(self) -> bool:
        """True if an initial state can be chosen by its index."""
        return self.declared.begin is not None or self.declared.initial_states is not None

    def _begin(self, init: int) -> Any:
        environment, states = self.environment, self.declared.initial_states
        if self.declared.begin is not None:
            return self.declared.begin(environment, init)
        if states is None:
            return environment.reset(seed=0)
        environment.seed(0)
        environment.reset()
        return environment.set_init_state(states[init])

    def _read(self, result: Any) -> Reading:
        raw = result[0] if isinstance(result, tuple) else result
        return read_observation(raw, self.declared.keys, self.is_vector)

    def step(self, action: Sequence[float] | Array) -> Played:
        """Play an action."""
        array = np.asarray(action, dtype=np.float64)
        if self.is_vector:
            array = np.tile(array, (self.environment.num_envs, 1))
        result = called("step()", self.environment.step, array)
        if not isinstance(result, tuple) or len(result) not in (4, 5):
            raise SubstrateError(
                f"step() returned {type(result).__name__}, but a step of an environment returns observation, "
                "reward, terminated, truncated and info (Gymnasium), or observation, reward, done and info "
                "(LIBERO)."
            )
        reward, *ends, info = (self._first(value) for value in result[1:])
        done = any(bool(end) for end in ends)
        truncated = len(ends) == 2 and bool(ends[1])
        return Played(
            self._read(result),
            reward,
            done,
            truncated,
            self._success(info, done and not truncated),
            len(result),
        )

    def _first(self, value: Any) -> Any:
        if not self.is_vector or isinstance(value, dict):
            return value
        return value[0]

    def _success(self, info: Any, ended: bool) -> bool:
        for key in ("is_success", "success"):
            if isinstance(info, dict) and key in info:
                return bool(np.ravel(info[key])[0])
        return ended

    def attribute(self, *names: str) -> Any:
        """Return the first attribute of one of these names, of it or of what it wraps; None for none."""
        for part in self._parts():
            for name in names:
                value = getattr(part, name, None)
                if value is not None:
                    return value
        return None

    def _parts(self) -> list[Any]:
        parts, seen = [self.environment], set[int]()
        for _ in range(_LEVELS):
            for part in [*parts]:
                if id(part) in seen:
                    continue
                seen.add(id(part))
                inner = [getattr(part, name, None) for name in ("env", "_env", "unwrapped")]
                inner += list(getattr(part, "envs", None) or ())[:1]
                parts += [
                    each for each in inner if each is not None and all(each is not part for part in parts)
                ]
        return parts

    @property
    def clock_s(self) -> float | None:
        """Simulated time, s; None where no simulator of MuJoCo is found."""
        simulator = self.attribute("sim", "data")
        time = getattr(getattr(simulator, "data", simulator), "time", None)
        return None if time is None else float(time)

    @property
    def fixtures(self) -> Array | None:
        """(N, 3) m: positions of all bodies in their parents, which no initial state holds; None likewise."""
        simulator = self.attribute("sim", "model")
        places = getattr(getattr(simulator, "model", simulator), "body_pos", None)
        return None if places is None else np.array(places)


def called(what: str, function: Callable[..., T], *arguments: Any) -> T:
    """Return what a function of the environment returns."""
    try:
        return function(*arguments)
    except Exception as error:  # an environment of others may raise anything
        raise SubstrateError(f"{what} raised {type(error).__name__}: {error}") from error


def open_environment(text: str) -> EnvironmentSubject:
    """Return the environment that ``PACKAGE:FACTORY:ARGUMENTS`` names; it is not opened yet."""
    from pytest_libero_max.worlds.threads import use_one_blas_thread

    use_one_blas_thread()  # as in every process that plays: its threads change last bits
    name = FactoryName.read(text)
    return EnvironmentSubject(name.load(), str(name.absolute()))


def copied(reading: Reading) -> Reading:
    """Return a reading that later steps cannot alter."""
    return {role: value if isinstance(value, str) else np.array(value) for role, value in reading.items()}


def settled(subject: EnvironmentSubject) -> Reading:
    """Return the first observation that a policy is shown."""
    return copied(subject.begin(drawn=True))


@dataclass(frozen=True)
class Starts:
    """Beginnings of episodes, one after the other."""

    settled: Mapping[int, Reading]
    """The first time from each initial state, by index."""
    returned: Reading
    """The reference's initial state, after episodes from others."""
    fixtures: Array | None
    """(N, 3) m, in the first of them; None without a simulator of MuJoCo."""
    fixtures_later: Array | None
    """Likewise, at :attr:`returned`."""


def starts(subject: EnvironmentSubject) -> Starts:
    """Begin in a new environment from the reference's initial state, from 0, 1 and 2, and from the first."""
    init = subject.reference.init
    between = (0, 1, 2) if subject.chooses else ()
    subject.abandon()  # the first episode of an environment may differ from all others
    readings = {init: copied(subject.begin(init, drawn=True))}
    fixtures = subject.fixtures
    for index in between:
        reading = copied(subject.begin(index, drawn=True))
        readings.setdefault(index, reading)
    returned = copied(subject.begin(init, drawn=True))
    return Starts(readings, returned, fixtures, subject.fixtures)


class Moved(NamedTuple):
    """A movement of the hand."""

    way: Array
    """(3,) m, world."""
    turn: Array | None
    """(3,) rad, world; None without a quaternion."""


def moved(subject: EnvironmentSubject, action: Sequence[float], steps: int) -> Moved:
    """Return the movement under the same action for some steps, from the settled state."""
    before = copied(subject.begin())
    for _ in range(steps):
        after = subject.step(action).reading
    way = hand_of(after)[0] - hand_of(before)[0]
    if "quaternion" not in before:
        return Moved(way, None)
    return Moved(way, turn_between(before["quaternion"], after["quaternion"]))


def along_axes(subject: EnvironmentSubject) -> tuple[Moved, ...]:
    """Return the movements under +1 in the first three components."""
    return tuple(moved(subject, move.action, move.steps) for move in subject.reference.moves[:3])


ROLES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "agentview": ("agentview_image", "pixels/image", "images/agentview", "observation/image", "image"),
        "robot0_eye_in_hand": (
            "robot0_eye_in_hand_image",
            "pixels/image2",
            "images/wrist",
            "observation/wrist_image",
            "wrist_image",
        ),
        "position": ("robot0_eef_pos", "robot_state/eef/pos"),
        "quaternion": ("robot0_eef_quat", "robot_state/eef/quat"),
        "gripper": ("robot0_gripper_qpos", "robot_state/gripper/qpos"),
        "joints": ("robot0_joint_pos", "robot_state/joints/pos"),
        "state": ("states", "observation/state", "state"),
        "instruction": ("task_description", "prompt", "instruction"),
    }
)
"""Names under which a thing is found in an observation, by its role: the cameras' images, the hand's position
(m) and quaternion (xyzw), the finger joints (m), the arm's joints (rad), a state vector of eight (position,
axis times angle, gripper), and the instruction."""

Reading = Mapping[str, Any]
"""Values of an observation by role."""


def read_observation(raw: Any, keys: Mapping[str, str], first: bool = False) -> dict[str, Any]:
    """Return the values of an observation by role, without the roles that it lacks."""
    flat = dict(_flattened(raw))
    reading = {}
    for role, names in ROLES.items():
        candidates = (keys[role],) if role in keys else names
        key = next((name for name in candidates if name in flat), None)
        if key is not None and flat[key] is not None:
            value = flat[key][0] if first else flat[key]
            reading[role] = value if isinstance(value, str) else np.asarray(value)
    return reading


def _flattened(raw: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(raw, Mapping):
        for key, value in raw.items():
            yield from _flattened(value, f"{path}/{key}" if path else str(key))
    else:
        yield path, raw


def images_of(reading: Reading) -> dict[str, NDArray[Any]]:
    """Return the images of a reading by camera."""
    return {camera: reading[camera] for camera in CAMERAS if camera in reading}


def hand_of(reading: Reading) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the position of the hand (3,) and of its fingers (2,), m, from wherever a reading has them."""
    state = reading.get("state")
    if "position" in reading and "gripper" in reading:
        position, gripper = reading["position"], reading["gripper"]
    elif state is not None and np.shape(state) == (8,):
        position, gripper = state[:3], state[6:]
    else:
        raise SubstrateError(
            "The observation has no position of the hand and its fingers. Declare where they are: "
            "DeclaredEnvironment(keys={'position': 'KEY', 'gripper': 'KEY'})."
        )
    return np.asarray(position, dtype=np.float64), np.asarray(gripper, dtype=np.float64)


def differing(first: Reading, second: Reading) -> list[str]:
    """Return what differs between two readings, in words with the size of the difference."""
    parts = []
    for role, value in first.items():
        later = second.get(role)
        if isinstance(value, str) or later is None or np.shape(value) != np.shape(later):
            if value is not later and not (isinstance(value, str) and value == later):
                parts.append(role)
        elif not np.array_equal(value, later):
            parts.append(f"{role} {_size(role, value, later)}")
    return parts


def _size(role: str, first: NDArray[Any], second: NDArray[Any]) -> str:
    apart = np.abs(np.asarray(first, dtype=float) - np.asarray(second, dtype=float))
    if role in CAMERAS:
        share = float((apart.reshape(*apart.shape[:2], -1).max(axis=2) > 0).mean())
        return f"in {100 * share:.1f} % of its pixels"
    if role in ("position", "gripper"):
        return f"by {1000 * apart.max():.3g} mm"
    return f"by {apart.max():.3g}"
