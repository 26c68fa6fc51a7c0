"""Policies, sound ones and each with one mistake, for the rules of policies."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients.transport import LOG as SERVER_LOG
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.policies.transforms.states import axis_angle, axis_angle_antipodal, rotation_6d_columns
from pytest_libero_max.worlds.contract import Observation

SPEC = PolicySpec("sound", horizon=8, query_interval=4, image_size=32)


class Sound:
    """Answers from everything that it is shown; draws from the seed of the query."""

    def __init__(self) -> None:
        self.spec = SPEC

    def reset(self, episode: Episode) -> None:
        pass

    def image(self, image: Any) -> Any:
        return rotate_180(image)

    def rotation(self, quaternion: Any) -> Any:
        return axis_angle(quaternion)

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        return {
            "image": self.image(observation["agentview_image"]),
            "wrist_image": self.image(observation["robot0_eye_in_hand_image"]),
            "state": np.concatenate(
                [
                    observation["robot0_eef_pos"],
                    self.rotation(observation["robot0_eef_quat"]),
                    observation["robot0_gripper_qpos"],
                ]
            ),
        }

    def chunk(self, observation: Observation, query: Query) -> Any:
        told = self.model_inputs(observation, query)
        number = zlib.crc32(query.instruction.encode())
        for value in told.values():
            number = zlib.crc32(np.ascontiguousarray(value).tobytes(), number)
        actions = np.random.default_rng([number, query.seed]).uniform(-0.8, 0.8, (8, 7))
        actions[:, 6] = -1.0
        return actions

    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[: self.spec.horizon]


def picturing(name: str, image: Callable[[Any], Any]) -> type[Sound]:
    """Return a policy that makes its images from the world's in another way."""
    return type(name, (Sound,), {"image": lambda self, delivered: image(delivered)})


Flipped = picturing("Flipped", lambda image: image[::-1])
Mirrored = picturing("Mirrored", lambda image: image[:, ::-1])
AsDelivered = picturing("AsDelivered", lambda image: image)
Transposed = picturing("Transposed", lambda image: image.transpose(1, 0, 2))
FlippedPart = picturing("FlippedPart", lambda image: image[:22][::-1])  # the wall is cut off
Bgr = picturing("Bgr", lambda image: rotate_180(image)[:, :, ::-1])


def turning(name: str, rotation: Callable[[Any], Any]) -> type[Sound]:
    """Return a policy that reads the hand's quaternion in another way."""
    return type(name, (Sound,), {"rotation": lambda self, quaternion: rotation(quaternion)})


Antipodal = turning("Antipodal", axis_angle_antipodal)
WFirst = turning("WFirst", lambda quaternion: axis_angle(np.roll(quaternion, -1)))


def scaled(name: str, movement: float, rotation: float, gripper: float = 1.0) -> type[Sound]:
    """Return a policy whose actions are multiplied by factors."""
    factors = [movement] * 3 + [rotation] * 3 + [gripper]
    return type(
        name, (Sound,), {"chunk": lambda self, shown, query: Sound.chunk(self, shown, query) * factors}
    )


Unnormalised = scaled("Unnormalised", 40.0, 40.0)
Small = scaled("Small", 0.05, 0.05)  # in metres; the gripper is right, and is the largest component
SmallRotation = scaled("SmallRotation", 1.0, 0.01)
Degrees = scaled("Degrees", 1.0, 57.3)
Clipped = scaled("Clipped", 3.0, 3.0)
WideGripper = scaled("WideGripper", 1.0, 1.0, 255.0)
ClosingFirst = scaled("ClosingFirst", 1.0, 1.0, -1.0)


class Exchanged(Sound):
    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        return {**told, "image": told["wrist_image"], "wrist_image": told["image"]}


class Writing(Sound):
    def rotation(self, quaternion: Any) -> Any:
        quaternion[3] = abs(quaternion[3])
        quaternion[:3] *= 0.5
        return axis_angle(quaternion)


class Stale(Sound):
    def __init__(self) -> None:
        super().__init__()
        self.kept: Any = None

    def chunk(self, observation: Observation, query: Query) -> Any:
        if self.kept is None:
            self.kept = super().chunk(observation, query)
        return self.kept


class OwnGenerator(Sound):
    def __init__(self) -> None:
        super().__init__()
        self.generator = np.random.default_rng(0)

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * [*self.generator.uniform(0.5, 1.0, 6), 1.0]


class Leaking(Sound):
    """Counts its queries over all episodes, and moves less at every seventh."""

    asked = 0

    def chunk(self, observation: Observation, query: Query) -> Any:
        self.asked += 1
        actions = super().chunk(observation, query)
        return actions * 0.5 if self.asked % 7 == 0 else actions


class Remembering(Sound):
    def reset(self, episode: Episode) -> None:
        self.last = np.zeros((8, 7))

    def chunk(self, observation: Observation, query: Query) -> Any:
        self.last = 0.5 * (self.last + super().chunk(observation, query))
        return self.last


class Copied(Remembering):
    """Sound: it remembers, and says so."""

    def snapshot(self) -> Any:
        return copy.deepcopy(self.last)

    def restore(self, memory: Any) -> None:
        self.last = copy.deepcopy(memory)


class Aliased(Copied):
    def chunk(self, observation: Observation, query: Query) -> Any:
        self.last[:] = 0.5 * (self.last + Sound.chunk(self, observation, query))
        return self.last.copy()

    def snapshot(self) -> Any:
        return self.last

    def restore(self, memory: Any) -> None:
        self.last = memory


class Drifting(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[: 8 - query.index]


class ShortChunk(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[:6][: self.spec.horizon]


class Suffix(Sound):
    def predict(self, observation: Observation, query: Query) -> Any:
        return self.chunk(observation, query)[-self.spec.horizon :]


class Blind(Sound):
    """Tells the images, and answers from the state alone."""

    def chunk(self, observation: Observation, query: Query) -> Any:
        dark = {key: np.zeros_like(value) for key, value in observation.items() if key.endswith("_image")}
        return super().chunk({**observation, **dark}, query)


class Flag(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, 6] = 0.0
        return actions


class Opening(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, 6] = np.linspace(0.6, 0.95, 8)
        return actions


class Deaf(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, Query(query.index, query.step, "", query.seed))


class Broken(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        raise KeyError("agentview")


class NotFinite(Sound):
    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) / [*[1.0] * 3, 0.0, *[1.0] * 3]


class Parts(Sound):
    """Cuts every image, and stacks two frames of the wrist."""

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        return {
            "image": told["image"][10:],
            "wrist_image": np.stack([told["wrist_image"][2:-2, 2:-2]] * 2),
            "state": np.concatenate(
                [observation["robot0_eef_pos"], rotation_6d_columns(observation["robot0_eef_quat"])]
            ),
        }


class Unrecognisable(Sound):
    """Tells one camera as a heat map, nothing of the other, and a state of other numbers."""

    def model_inputs(self, observation: Observation, query: Query) -> dict[str, Any]:
        told = super().model_inputs(observation, query)
        seed = zlib.crc32(told["image"].tobytes())
        heat = np.random.default_rng(seed).integers(0, 256, (32, 32, 3), np.uint8)
        return {"heat": heat, "numbers": 3.0 * told["state"]}


class InCompany(Sound):
    """Answers in batches; the last digits depend on the size of the batch."""

    def predict_batch(self, items: Any) -> Any:
        return [
            self.chunk(item.observation, item.query) + self.rounding(items, place)
            for place, item in enumerate(items)
        ]

    def rounding(self, items: Any, place: int) -> float:
        return 1e-7 * len(items)


Undisturbed = type("Undisturbed", (InCompany,), {"rounding": lambda *_: 0.0})
Disturbed = type("Disturbed", (InCompany,), {"rounding": lambda self, items, place: 1e-7 * place})


class Reversed(InCompany):
    def predict_batch(self, items: Any) -> Any:
        return super().predict_batch(items)[::-1]


class Refusing(Sound):
    """Behind a server that retries what its adapter refuses, and warns of it."""

    def predict(self, observation: Observation, query: Query) -> Any:
        if self.spec.horizon < 8:
            SERVER_LOG.warning("the server reports an error; trying again")
            raise ServerError("it was given up")
        return self.chunk(observation, query)


class Posing(Sound):
    """Under absolute control; stays near the hand."""

    def __init__(self) -> None:
        self.spec = replace(SPEC, control="absolute")

    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, :3] = observation["robot0_eef_pos"] + 0.05 * actions[:, :3]
        actions[:, 3:6] *= 3.0
        return actions


class MovingAsPosing(Sound):
    def __init__(self) -> None:
        self.spec = replace(SPEC, control="absolute")


class PosingAsMoving(Posing):
    def __init__(self) -> None:
        self.spec = SPEC

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) + np.array([0, 0, 0, 3.0, 0, 0, 0])


class Redeclaring(Sound):
    """Executes fewer actions from its first query on."""

    def predict(self, observation: Observation, query: Query) -> Any:
        answer = super().predict(observation, query)
        self.spec = replace(self.spec, query_interval=2)
        return answer

    def reset(self, episode: Episode) -> None:
        self.spec = replace(self.spec, query_interval=4)


class Stateless(Sound):
    """Answers from images and instruction alone."""

    def chunk(self, observation: Observation, query: Query) -> Any:
        still = {key: value for key, value in observation.items() if key.endswith("_image")}
        state = {key: np.ones_like(value) for key, value in observation.items() if key not in still}
        return super().chunk({**still, **state}, query)


class LearningTasks(Sound):
    """Keeps the first task that it was given, and does everything a little slower in all others."""

    def __init__(self) -> None:
        super().__init__()
        self.tasks: set[int] = set()

    def reset(self, episode: Episode) -> None:
        self.tasks.add(episode.task_index)

    def chunk(self, observation: Observation, query: Query) -> Any:
        return super().chunk(observation, query) * ([1.0 / len(self.tasks)] * 6 + [1.0])


class Still(Sound):
    """Answers from everything, with the gripper alone."""

    def chunk(self, observation: Observation, query: Query) -> Any:
        actions = super().chunk(observation, query)
        actions[:, 6] = -np.abs(actions[:, 0])
        actions[:, :6] = 0.0
        return actions
