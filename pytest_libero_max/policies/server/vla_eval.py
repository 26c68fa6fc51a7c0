"""The server's end of vla-eval's protocol, for harnesses that speak it.

They show images turned by 180 degrees and the hand as position, axis angle and fingers; these become an
observation as worlds deliver it, of the images, ``robot0_eef_pos``, ``robot0_eef_quat`` and
``robot0_gripper_qpos`` alone. Each observation is answered with one action. The policy is asked when the Q
actions of its last answer are used up, and when an episode begins.
"""

from __future__ import annotations

import io
import math
import secrets
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.cases import step_budget
from pytest_libero_max.benchmark.suites import longest_budget
from pytest_libero_max.errors import AdapterError, LiberoMaxError, ServerError
from pytest_libero_max.policies.clients.codecs import VLA_EVAL, Dialect, array_from, pack, shortened, unpack
from pytest_libero_max.policies.clients.protocols.vla_eval import PROTOCOL_VERSION
from pytest_libero_max.policies.clients.transport import LOG
from pytest_libero_max.policies.contract import BatchItem, Episode, Query, query_seed
from pytest_libero_max.policies.server.host import Host, InferenceRequest, Place
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.worlds.contract import height_and_width
from pytest_libero_max.worlds.robot import CAMERAS

if TYPE_CHECKING:
    from websockets.sync.server import ServerConnection

MOST_PIXELS = 2**24
"""The largest image that is decoded."""

_STATE = 8
_IMAGES = MappingProxyType(dict(zip(CAMERAS, ("agentview", "wrist"), strict=True)))


class Session:
    """One connection of a harness, which plays one episode after another."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._spec = host.spec
        self._client = secrets.token_hex(8)
        self._task: Mapping[str, Any] | None = None
        self._queue: deque[NDArray[np.float64]] = deque()
        self._batch = 1
        self._index = self._step = 0
        self._memory: str | None = None

    def greeting(self) -> dict[str, Any]:
        """Return the server's description of itself."""
        spec = self._spec
        if self._host.sees:
            raise AdapterError(
                f"policy {spec.name!r} is shown every step (see), which this side of vla-eval's protocol "
                "does not do. Ask the server at / with openpi:// and --libero-max-profile=served."
            )
        poses = {"absolute_action": True} if spec.control == "absolute" else {}
        return {
            "harness_version": "pytest-libero-max",
            "protocol_version": PROTOCOL_VERSION,
            "model_server": spec.name,
            "capabilities": {"memory": self._host.remembers},
            "observation_params": {
                "send_wrist_image": CAMERAS[1] in spec.cameras,
                "send_state": True,
                "quat_no_antipodal": True,
                **poses,
            },
        }

    def reply(self, kind: str, payload: Mapping[str, Any]) -> tuple[str, dict[str, Any]] | None:
        """Type and payload of the reply to a message; None where it gets none."""
        match kind:
            case "hello":
                return "hello", self.greeting()
            case "episode_start":
                self._begin(payload)
            case "episode_end":
                self._task = None
            case "observation":
                return "action", self._act(payload)
            case "error":
                LOG.warning("a client reports an error: %s", shortened(str(payload.get("error"))))
            case _:
                raise ServerError(f"a message of the unknown type {shortened(kind)}")
        return None

    def _begin(self, payload: Mapping[str, Any]) -> None:
        task = payload.get("task")
        self._task = task if isinstance(task, Mapping) else {}
        self._queue.clear()
        self._index = self._step = 0
        self._memory = None

    def _act(self, payload: Mapping[str, Any]) -> dict[str, Any]:
        if self._task is None:
            raise ServerError("an observation came before any episode_start")
        if not self._queue:
            self._ask(payload, self._task)
        self._step += 1
        return {"actions": self._queue.popleft(), "batch": self._batch}

    def _ask(self, payload: Mapping[str, Any], task: Mapping[str, Any]) -> None:
        suite, text = task.get("suite"), payload.get("task_description", task.get("name"))
        instruction = text if isinstance(text, str) else ""
        suite = suite if isinstance(suite, str) else ""
        episode = Episode(
            suite,
            _whole(task.get("task_id")),
            instruction,
            _whole(task.get("episode_idx")),
            step_budget(suite) or longest_budget(),
        )
        seed = payload.get("seed")
        query = Query(
            self._index,
            self._step,
            instruction,
            query_seed(episode.seed, self._index) if seed is None else _whole(seed),
        )
        item = BatchItem(self._observation(payload), query, episode)
        place = Place(self._client, self._memory) if self._host.remembers else None
        answer = self._host.ask(InferenceRequest(item, place))
        self._index += 1
        self._memory, self._batch = answer.memory, answer.batch
        self._queue.extend(answer.actions[: self._spec.query_interval])

    def _observation(self, payload: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        images, shape = payload.get("images"), (*height_and_width(self._spec.image_size), 3)
        images = images if isinstance(images, Mapping) else {}
        observation: dict[str, NDArray[Any]] = {}
        for camera in self._spec.cameras:
            name = _IMAGES.get(camera, camera)
            image = images.get(name)
            if not isinstance(image, np.ndarray) or (image.dtype, image.shape) != (np.uint8, shape):
                seen = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else "not there"
                raise ServerError(f"images[{name!r}] is {seen}, but the policy wants uint8 {shape}")
            observation[f"{camera}_image"] = rotate_180(image)
        if "states" in payload:
            states = payload["states"]
            if (
                not isinstance(states, np.ndarray)
                or states.shape != (_STATE,)
                or states.dtype.kind not in "fiu"
                or not np.isfinite(states).all()
            ):
                raise ServerError("'states' must be eight finite numbers: position, axis angle, fingers")
            values = states.astype(np.float64)
            observation["robot0_eef_pos"] = values[:3]
            observation["robot0_eef_quat"] = quaternion(values[3:6])
            observation["robot0_gripper_qpos"] = values[6:]
        return observation


def talk(connection: ServerConnection, host: Host) -> None:
    """Answer a harness until it leaves or sends an invalid message."""
    from websockets.exceptions import ConnectionClosed

    session = Session(host)
    with suppress(ConnectionClosed):
        for content in connection:
            seq, goes_on = 0, False
            try:
                message = unpack(content, WITH_IMAGES)
                kind, payload, seq = _opened(message)
                goes_on = True
                reply = session.reply(kind, payload)
            except Exception as error:  # whatever a message brings about is the client's to know
                LOG.warning("%s", error, exc_info=not isinstance(error, LiberoMaxError))
                host.refused(error)
                reply = "error", {"error": f"{type(error).__name__}: {error}"}
            if reply is not None:
                kind, payload = reply
                message = {"type": kind, "payload": payload, "seq": seq, "timestamp": time.time()}
                connection.send(pack(message, VLA_EVAL))
            if not goes_on:
                return


def quaternion(axis_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4,) x, y, z, w of an axis times its angle in rad; w < 0 where the angle exceeds pi."""
    with np.errstate(over="ignore"):
        angle = float(np.linalg.norm(axis_angle))
    if not math.isfinite(angle):
        raise ServerError(f"'states' hold an axis angle of {axis_angle.tolist()}, whose length is no number")
    if angle == 0.0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    return np.append(axis_angle / angle * math.sin(angle / 2.0), math.cos(angle / 2.0))


def _opened(message: Any) -> tuple[str, Mapping[str, Any], int]:
    if isinstance(message, dict):
        kind, payload, seq = (message.get(key) for key in ("type", "payload", "seq"))
        if isinstance(kind, str) and isinstance(payload, dict) and type(seq) is int:
            return kind, payload, seq
    raise ServerError("a message is no map with a text as 'type', a map as 'payload' and an integer as 'seq'")


def _whole(value: Any) -> int:
    """Return an integer of a message; 0 where there is none."""
    if value is None:
        return 0
    if not isinstance(value, int) or isinstance(value, bool):
        raise ServerError(f"{shortened(str(value))} came where an integer belongs")
    return value


def _decode(value: dict[Any, Any]) -> Any:
    if "__image__" not in value:
        return VLA_EVAL.decode(value)
    data, kind = value.get("data"), value.get("format")
    if kind == "raw":
        return array_from(data, value.get("dtype"), value.get("shape"))
    if kind not in ("png", "jpeg") or not isinstance(data, bytes):
        raise ServerError(f"an image of the format {shortened(str(kind))}; raw, png and jpeg are read")
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=(kind,)) as image:
            if image.width * image.height > MOST_PIXELS:
                raise ServerError(f"an image of {image.width} x {image.height} pixels")
            return np.array(image.convert("RGB"))
    except ServerError:
        raise
    except Exception as error:  # Pillow raises what its decoders do
        raise ServerError(f"an image that cannot be read ({type(error).__name__}: {error})") from error


WITH_IMAGES = Dialect(VLA_EVAL.encode, _decode)
