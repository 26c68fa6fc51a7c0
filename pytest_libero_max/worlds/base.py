"""Base of worlds, whatever simulates them: names, instruction and goal, filters, what is parked, actions.

A subclass adds the simulator: how a step is played, what is seen, what a snapshot holds, where things are.
:class:`.mujoco_world.MujocoWorld` is the one for MuJoCo.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import ActionError, EntityError, SubstrateError, counted, did_you_mean
from pytest_libero_max.worlds.contract import (
    Array,
    Control,
    Entity,
    Goal,
    Image,
    ImageSize,
    PixelFilter,
    Semantics,
    World,
)
from pytest_libero_max.worlds.robot import PANDA, Robot


class WorldBase(ABC):
    """What every world keeps of an episode besides the state of its simulator.

    Args:
        scene: Stable key of the scene, for example ``embedded/libero_spatial/0``.
        entities: Entities that a case can name.
        robot: Robot of the scene.
    """

    def __init__(
        self, scene: str, language: str, entities: Mapping[str, Entity], robot: Robot = PANDA
    ) -> None:
        self._scene = scene
        self._language = language
        self._entities = dict(entities)
        self._robot = robot
        self._begin_episode()

    def _begin_episode(self) -> None:
        """Forget the last episode."""
        self._steps = 0
        self._filters: tuple[tuple[PixelFilter, int], ...] = ()
        self._parked: dict[str, tuple[float, ...]] = {}
        self._assigned: tuple[str | None, Goal | None] = (None, None)
        self._control: Control = "delta"

    # What a subclass adds.

    @abstractmethod
    def _proprioception(self) -> dict[str, Array]:
        """Return the observations of the robot that are no images, by its keys, freshly copied."""

    @abstractmethod
    def _drawn(self, camera: str, size: ImageSize) -> Image:
        """Return an image as the simulator draws it, before any filter, bottom row first."""

    def _after_alteration(self) -> None:  # noqa: B027 - most worlds have nothing to do here
        """Follow-up of an alteration from outside, once the world is settled in its altered state."""

    def _check_goal(self, goal: Goal) -> None:
        """Refuse a goal that the world cannot decide; a world that can decide any of them overrides this."""
        raise SubstrateError(f"{self._scene} decides its own goal only, not {goal!r}.")

    # The contract.

    @property
    def scene(self) -> str:
        return self._scene

    @property
    def robot(self) -> Robot:
        return self._robot

    @property
    def language(self) -> str:
        return self._language if self._assigned[0] is None else self._assigned[0]

    @property
    def assigned(self) -> tuple[str | None, Goal | None]:
        return self._assigned

    @property
    def control(self) -> Control:
        """Meaning of the actions of :meth:`step`; ``delta`` after a reset."""
        return self._control

    @property
    def semantics(self) -> Semantics:
        return "corrected"

    @property
    def entities(self) -> Mapping[str, Entity]:
        return MappingProxyType(self._entities)

    @property
    def steps(self) -> int:
        """Control steps since reset."""
        return self._steps

    @property
    def filters(self) -> tuple[tuple[PixelFilter, int], ...]:
        return self._filters

    @property
    def parked(self) -> tuple[str, ...]:
        return tuple(self._parked)

    def set_control(self, control: Control) -> None:
        if control not in get_args(Control):
            raise SubstrateError(f"control={control!r}. {did_you_mean(str(control), get_args(Control))}")
        self._control = control

    def observe(self, cameras: Sequence[str] | None = None, size: ImageSize = 256) -> dict[str, NDArray[Any]]:
        observation: dict[str, NDArray[Any]] = dict(self._proprioception())
        if any(getattr(filter, "hides_state", False) for filter, _ in self._filters):
            for name, value in observation.items():
                value[:] = 0.0
                value[-1] = name.endswith("_quat")
        for camera in self._robot.cameras if cameras is None else cameras:
            observation[f"{camera}_image"] = self._image(camera, size)
        return observation

    def parked_pose(self, entity: str) -> tuple[Array, Array]:
        name = self._known(entity)
        if name not in self._parked:
            raise SubstrateError(f"{name!r} is not parked. {did_you_mean(name, self._parked)}")
        values = np.array(self._parked[name])
        return values[:3], values[3:]

    def other_task(self, suite: str, index: int) -> World:
        raise SubstrateError(f"{self._scene} was built without a substrate, so it knows no other task.")

    def add_filter(self, filter: PixelFilter) -> None:
        if " at 0x" in repr(filter):
            raise SubstrateError(
                f"filter={filter!r}: the digest knows a filter by its repr, so that has to say everything "
                "the filter depends on. Make it a frozen dataclass with a __call__ method."
            )
        self._filters = (*self._filters, (filter, self._steps))
        self._after_alteration()

    def remove_filter(self, index: int) -> None:
        if not 0 <= index < len(self._filters):
            raise SubstrateError(
                f"index={index!r}, but the world has {counted(len(self._filters), 'pixel filter')}."
            )
        self._filters = (*self._filters[:index], *self._filters[index + 1 :])
        self._after_alteration()

    def arm_joints(self) -> Array:
        return self._proprioception()[self._robot.joints_key]

    def fingers(self) -> Array:
        return self._proprioception()[self._robot.fingers_key]

    def pose_arm(self, joints: Sequence[float] | Array) -> None:
        raise SubstrateError(f"{self._scene} has no arm whose joints could be posed.")

    def open_gripper(self) -> None:
        raise SubstrateError(f"{self._scene} has no gripper with a command of its own that could be opened.")

    def assign(self, instruction: str | None = None, goal: Goal | None = None) -> None:
        if goal is not None:
            self._check_goal(goal)
        words, target = self._assigned
        self._assigned = (words if instruction is None else instruction, target if goal is None else goal)

    def reassign(self, assigned: tuple[str | None, Goal | None]) -> None:
        if assigned[1] is not None:
            self._check_goal(assigned[1])
        self._assigned = assigned

    # Inside.

    def _image(self, camera: str, size: ImageSize) -> Image:
        image = self._drawn(camera, size)
        for filter, since in self._filters:
            image.flags.writeable = False
            filtered = filter(image, camera, self._steps - since)
            if filtered.shape != image.shape or filtered.dtype != np.uint8:
                raise SubstrateError(
                    f"filter={filter!r} returned {filtered.dtype} {filtered.shape} for a uint8 {image.shape} "
                    "image: a pixel filter keeps shape and type."
                )
            image = filtered
        return image if image.flags.writeable else image.copy()

    def _checked_action(self, action: Sequence[float] | Array) -> Array:
        values, size = np.array(action, dtype=np.float64), len(self._robot.noop)
        if values.shape != (size,):
            raise ActionError(f"action.shape={values.shape}, but a control step takes ({size},).")
        if not all(map(math.isfinite, values.tolist())):
            raise ActionError(f"action={values.tolist()} has a component that is not finite.")
        return values

    def _known(self, entity: str) -> str:
        if entity not in self._entities:
            hint = did_you_mean(entity, self._entities)
            raise EntityError(f"{self._scene} has no entity {entity!r}. {hint}")
        return entity

    def _memory(self) -> str:
        """Return what a digest has to cover besides the simulator's state, as text."""
        return repr((self._scene, self._steps, tuple(self._parked.items()), self._filters, self._assigned))
