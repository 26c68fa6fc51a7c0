"""Every profile against a fake server that looks at all it is sent: keys, types, orientation, state."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.clients.codecs import JSON_NUMPY, MSGPACK_NUMPY, OPENPI, pack, unpack
from pytest_libero_max.policies.clients.messages import Reply, Request
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.profile import load_profile, profile_names
from pytest_libero_max.policies.server import openpi
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.policies.clients import fakes

AXIS_ANGLE = np.array([0.8, 0.36, 0.48]) * 2 * np.arccos(-0.6)
"""Of the fake's quaternion (0.64, 0.288, 0.384, -0.6), its sign kept: more than pi."""

SHORT = -np.array([0.8, 0.36, 0.48]) * 2 * np.arccos(0.6)
"""The same rotation by the antipodal rule."""

POSITION, FINGERS = [0.1, 0.2, 0.9], [0.04, -0.03]

CLOSING = np.array([[0.5, 0, 0, 0, 0, 0, 1.0]])
"""Moves along x and closes the gripper, in LIBERO's convention."""


def is_turned(image: Any, channel: int, side: int) -> bool:
    """Whether an image is uint8 of that side, with its square in the last corner alone."""
    near, far = side // 16, side - side // 16
    return bool(
        image.dtype == np.uint8
        and image.shape == (side, side, 3)
        and image[far, far, channel] > 240
        and image[far, far].sum() < 300
        and max(image[near, near].max(), image[near, far].max(), image[far, near].max()) < 16
    )


def is_state(state: Any, rotation: Any = AXIS_ANGLE, shape: tuple[int, ...] = (8,)) -> bool:
    return bool(state.shape == shape) and np.allclose(
        state.ravel(), [*POSITION, *rotation, *FINGERS], atol=1e-6
    )


def check_pi05(request: Any) -> None:
    assert set(request) == {"observation/image", "observation/wrist_image", "observation/state", "prompt"}
    assert is_turned(request["observation/image"], 0, 224)
    assert is_turned(request["observation/wrist_image"], 1, 224)
    assert is_state(request["observation/state"])
    assert request["observation/state"].dtype == np.float64
    assert request["prompt"] == fakes.EPISODE.instruction


def check_oft(request: Any) -> None:
    path, body = request
    assert path == "/act"
    assert set(body) == {"full_image", "wrist_image", "state", "instruction"}
    assert is_turned(JSON_NUMPY.decode(body["full_image"]), 0, 224)
    assert is_turned(JSON_NUMPY.decode(body["wrist_image"]), 1, 224)
    assert is_state(JSON_NUMPY.decode(body["state"]))
    assert body["instruction"] == fakes.EPISODE.instruction.lower()


def check_dm05(request: Any) -> None:
    path, body = request
    assert path == "/v1/infer"
    assert set(body) == {"observation", "sampling"}
    assert body["sampling"] == {"seed": 1234}
    seen = body["observation"]
    assert set(seen) == {"prompt", "state", "images"}
    assert seen["prompt"] == fakes.EPISODE.instruction
    assert is_state(np.array(seen["state"]))
    for key, channel in (("1", 0), ("2", 1)):
        file = np.frombuffer(base64.b64decode(seen["images"][key]), np.uint8)
        decoded = cv2.imdecode(file, cv2.IMREAD_COLOR)
        assert decoded is not None
        assert is_turned(decoded[:, :, ::-1], channel, 256)


def check_vla_jepa(request: Any) -> None:
    assert set(request) == {"type", "payload"}
    assert request["type"] == "infer"
    payload = request["payload"]
    ((scene, wrist),) = payload["batch_images"]
    assert is_turned(scene, 0, 224)
    assert is_turned(wrist, 1, 224)
    assert payload["instructions"] == [fakes.EPISODE.instruction]
    assert is_state(payload["state"][0], shape=(1, 8))
    assert payload["unnorm_key"] == "franka"


def check_starvla(request: Any) -> None:
    (example,) = request["payload"]["examples"]
    assert set(example) == {"image", "lang", "state"}
    assert is_turned(example["image"][0], 0, 224)
    assert is_turned(example["image"][1], 1, 224)
    assert is_state(example["state"], shape=(1, 8))


def check_dit4dit(request: Any) -> None:
    assert "payload" not in request
    (example,) = request["examples"]
    (both,) = example["image"]
    assert both.shape == (224, 448, 3)
    assert is_turned(both[:, :224], 0, 224)
    assert is_turned(both[:, 224:], 1, 224)
    state = example["state"]
    assert state.dtype == np.float32
    assert state.shape == (1, 16)
    values = np.array([*POSITION, *AXIS_ANGLE, *FINGERS])
    assert np.allclose(state[0, 0::2], np.sin(values), atol=1e-5)
    assert np.allclose(state[0, 1::2], np.cos(values), atol=1e-5)


def check_gr00t(request: Any) -> None:
    assert request["options"] is None
    seen = request["observation"]
    words = "annotation.human.action.task_description"
    flat = words in seen
    if not flat:
        seen = {
            f"{kind}.{key}": value for kind in ("video", "state") for key, value in seen[kind].items()
        } | {words: seen["language"][words][0]}
    assert len(seen) == 10
    assert seen[words] == [fakes.EPISODE.instruction]
    for key, channel in (("video.image", 0), ("video.wrist_image", 1)):
        assert seen[key].shape == (1, 1, 256, 256, 3)
        assert is_turned(seen[key][0, 0], channel, 256)
    values = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), [*POSITION, *AXIS_ANGLE], strict=True))
    for name, value in values.items():
        assert seen[f"state.{name}"].shape == (1, 1, 1)
        assert seen[f"state.{name}"].dtype == np.float32
        assert np.isclose(seen[f"state.{name}"].item(), value, atol=1e-5)
    assert seen["state.gripper"].dtype == np.float32
    assert np.allclose(seen["state.gripper"], [[FINGERS]])


def check_vla_eval(request: Any) -> None:
    assert set(request) == {"images", "task_description", "states", "controller_states"}
    assert is_turned(request["images"]["agentview"], 0, 256)
    assert is_turned(request["images"]["wrist"], 1, 256)
    assert is_state(request["states"], SHORT)
    assert request["controller_states"].shape == (8,)
    assert not is_state(request["controller_states"], SHORT)
    assert request["task_description"] == fakes.EPISODE.instruction


def check_wrapped(
    request: Any,
    side: int = 256,
    state: Any = (*POSITION, *AXIS_ANGLE, *FINGERS),
    dtype: str = "float64",
    prompt: str = "put the Box on the plate",
) -> None:
    assert set(request) == {"prompt", "observation", "query", "episode"}
    assert request["prompt"] == prompt
    assert request["query"] == {"index": 0, "step": 0, "seed": 1234}
    assert request["episode"]["instruction"] == fakes.EPISODE.instruction
    seen = request["observation"]
    assert set(seen) == {"image", "wrist_image", "state"}
    assert is_turned(seen["image"], 0, side)
    assert is_turned(seen["wrist_image"], 1, side)
    assert seen["state"].dtype == dtype
    assert seen["state"].shape == (len(state),)
    assert np.allclose(seen["state"], state, atol=1e-6)


def check_robomimic(request: Any) -> None:
    seen = request["observation"]
    assert set(seen) == {
        "agentview_image",
        "robot0_eye_in_hand_image",
        "robot0_eef_pos",
        "robot0_eef_quat",
        "robot0_gripper_qpos",
    }
    for channel, key in enumerate(("agentview_image", "robot0_eye_in_hand_image")):
        upright = np.zeros((3, 84, 84), dtype=np.float32)
        upright[channel, -10:, :10] = 1.0
        assert seen[key].dtype == np.float32
        assert np.array_equal(seen[key], upright)
    raw = fakes.observation(84)
    for key in ("robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos"):
        assert np.allclose(seen[key], raw[key])


def check_cosmos_policy(request: Any) -> None:
    mirrored = {
        key: value[:, ::-1] if key != "state" else value for key, value in request["observation"].items()
    }
    state = (*FINGERS, *POSITION, 0.64, 0.288, 0.384, -0.6)
    check_wrapped({**request, "observation": mirrored}, state=state)


def check_fastwam(request: Any) -> None:
    seen = request["observation"]
    assert set(seen) == {"image", "state"}
    assert seen["image"].shape == (224, 448, 3)
    images = {"image": seen["image"][:, :224], "wrist_image": seen["image"][:, 224:]}
    check_wrapped({**request, "observation": {**seen, **images}}, 224, dtype="float32", prompt=FILMED)


FILMED = (
    "A video recorded from a robot's point of view executing the following instruction: put the Box on the "
    "plate"
)


def check_xvla(request: Any) -> None:
    path, body = request
    assert path == "/act"
    assert set(body) == {"domain_id", "proprio", "language_instruction", "image0", "image1"}
    assert body["domain_id"] == 3
    assert body["language_instruction"] == fakes.EPISODE.instruction
    assert all(isinstance(body[key], str) for key in ("proprio", "image0", "image1"))
    scene, wrist, proprio = (
        JSON_NUMPY.decode(json.loads(body[key])) for key in ("image0", "image1", "proprio")
    )
    assert is_turned(scene, 0, 256)
    assert is_turned(wrist[::-1, ::-1], 1, 256)  # the wrist's is sent as the world delivers it
    assert proprio.dtype == np.float64
    assert proprio.shape == (20,)
    matrix = Rotation.from_quat([0.64, 0.288, 0.384, -0.6]).as_matrix() @ QUARTER_TURN
    assert np.allclose(proprio[:9], [*POSITION, *matrix[:, 0], *matrix[:, 1]], atol=1e-6)
    assert not proprio[9:].any()


QUARTER_TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""From the hand to the grip site, about z."""

POSE = [0.15, -0.25, 0.65, *(np.array([0.6, 0.0, 0.8]) * 2.5), 1.0]
"""A position in reach of the tiny world's hand, a rotation, and the gripper closing."""


def poses(chunk: int) -> Any:
    return np.repeat(np.array([POSE]), chunk, axis=0)


def as_rotation_6d(chunk: int) -> Any:
    """The same as X-VLA says it: two arms, columns of any length, the chance that the gripper closes."""
    matrix = Rotation.from_rotvec(POSE[3:6]).as_matrix()
    first, second = 1.7 * matrix[:, 0], 0.6 * matrix[:, 1] + 0.3 * matrix[:, 0]
    return np.repeat(np.array([[*POSE[:3], *first, *second, 0.7, *[9.0] * 10]]), chunk, axis=0)


def opening_first(chunk: int) -> Any:
    """Actions whose gripper is 0 for closed and 1 for open."""
    actions = np.repeat(CLOSING, chunk, axis=0)
    actions[:, 6] = 0.0
    return actions


def closing(chunk: int) -> Any:
    return np.repeat(CLOSING, chunk, axis=0)


def in_parts(chunk: int, prefix: str) -> Any:
    names = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")
    columns = zip(names, opening_first(chunk).T, strict=True)
    return {prefix + name: column.reshape(1, chunk, 1).astype(np.float32) for name, column in columns}


Look = Callable[[Any], None]


@contextmanager
def serve(name: str, look: Look) -> Iterator[str]:
    """A fake server of the profile's protocol, which says CLOSING as its policy would; its address."""
    profile = load_profile(name)
    chunk = profile.get("policy", "horizon")
    chunk = 8 if chunk == "?" else chunk

    def answer(value: Any) -> Callable[[Any], Any]:
        def handle(request: Any) -> Any:
            look(request)
            return value

        return handle

    def gr00t(request: Any) -> Any:
        if request["endpoint"] == "ping":
            return {"status": "ok", "message": "here"}
        assert request["endpoint"] == "get_action"
        look(request["data"])
        return [in_parts(chunk, "" if name.endswith("nested") else "action."), {}]

    def vla_eval(request: Any) -> Any:
        if "episode_start" not in request:
            look(request)
        return poses(chunk) if name == "vla_eval_xvla" else closing(chunk)

    normalised = np.concatenate([np.repeat(CLOSING, chunk, axis=0), np.zeros((chunk, 1))], axis=1)
    normalised[:, 6] = -1.0  # below a half: flag 0, closed
    data = {"normalized_actions": normalised[None, :, : 8 if name == "dit4dit" else 7]}
    if name == "starvla":
        data = {"actions": opening_first(chunk)[None]}
    if profile.protocol == "openpi":
        actions = opening_first(chunk) if name in ("fastwam", "lightwam") else closing(chunk)
        with fakes.openpi(answer({"actions": actions, "policy_timing": {"infer_ms": 1.0}})) as port:
            yield f"openpi://127.0.0.1:{port}"
    elif profile.protocol == "starvla":
        reply = {"status": "ok", "ok": True, "type": "inference_result", "data": data}
        with fakes.openpi(answer(reply), {"env": "simpler_env"}) as port:
            yield f"starvla://127.0.0.1:{port}"
    elif profile.protocol == "http":
        actions = opening_first(chunk) if name == "openvla_oft" else closing(chunk)
        rows = [JSON_NUMPY.encode(row) for row in actions]
        if name == "xvla":
            with fakes.http(answer({"action": as_rotation_6d(chunk).tolist()})) as port:
                yield f"http://127.0.0.1:{port}"
            return
        with fakes.http(answer(rows if name == "openvla_oft" else {"actions": actions.tolist()})) as port:
            yield f"http://127.0.0.1:{port}"
    elif profile.protocol == "gr00t":
        with fakes.zeromq(gr00t, MSGPACK_NUMPY) as port:
            yield f"gr00t://127.0.0.1:{port}"
    else:
        wants = {"send_wrist_image": True, "send_state": True, "absolute_action": name == "vla_eval_xvla"}
        with fakes.vla_eval(vla_eval, chunk, {"observation_params": wants}) as port:
            yield f"vla-eval://127.0.0.1:{port}"


def playable(name: str, folder: Path) -> str:
    """The profile, with statistics of which 1 means 1 where it needs some."""
    if "actions.statistics" not in load_profile(name).unknown():
        return name
    bounds = {"action": {"min": [-1] * 7, "max": [1] * 7, "mask": [True] * 6 + [False]}}
    (folder / "dataset_statistics.json").write_text(json.dumps({"franka": bounds}))
    path = folder / f"{name}_here.toml"
    path.write_text(f'extends = "{name}"\n[actions]\nstatistics = "dataset_statistics.json"\n')
    return str(path)


CHECKS: dict[str, Look] = {
    "pi05_libero": check_pi05,
    "openvla_oft": check_oft,
    "dm05": check_dm05,
    "vla_jepa": check_vla_jepa,
    "starvla": check_starvla,
    "dit4dit": check_dit4dit,
    "gr00t_n17": check_gr00t,
    "gr00t_n17_nested": check_gr00t,
    "vla_eval": check_vla_eval,
    "vla_eval_pi05": check_vla_eval,
    "wrapped": check_wrapped,
    "robomimic": check_robomimic,
    "cosmos_policy": check_cosmos_policy,
    "fastwam": check_fastwam,
    "lightwam": partial(check_wrapped, dtype="float32", prompt=FILMED),
    "smolvla": partial(check_wrapped, side=360, dtype="float32"),
    "molmoact2": partial(check_wrapped, side=360, dtype="float32"),
    "xiaomi_robotics_0": partial(
        check_wrapped,
        state=(*POSITION, *AXIS_ANGLE, *FINGERS, *[0.0] * 24),
        prompt="Put the box on the plate.",
    ),
}
WRAPPED = [
    name
    for name, profile in ((name, load_profile(name)) for name in CHECKS)
    if "query" in profile.tables["request"]
]
UNKNOWN = ("himem_wam",)
"""Of policies whose code could not be read."""
POSING: dict[str, Look] = {"xvla": check_xvla, "vla_eval_xvla": check_vla_eval}
ELSEWHERE = ("served", "mimic_video")
"""Tested in ``test_sockets.py`` and ``test_every_step.py``, with their real server."""
TABLES_THAT_DIFFER = {"policy", "native", "published", "sources"}
"""Of the profiles that extend ``vla_eval``: they ask the same."""


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


@pytest.mark.parametrize("name", CHECKS)
def test_the_server_is_sent_what_its_policy_expects_and_its_actions_do_what_it_means(
    name: str, tmp_path: Path, world: TinyWorld
) -> None:
    seen: list[Any] = []
    with serve(name, seen.append) as address:
        policy = load_served(address, playable(name, tmp_path), *_missing(name))
        policy.reset(fakes.EPISODE)
        actions = policy.predict(fakes.observation(policy.spec.image_size), fakes.query())
        policy.client.close()
    CHECKS[name](seen[0])
    assert len(seen) == 1
    assert policy.spec.query_interval <= len(actions) <= policy.spec.horizon
    assert np.allclose(actions, CLOSING, atol=1e-6)
    # What the actions mean: the hand moves along x and the fingers close.
    world.reset(0)
    for _ in range(8):
        world.step((0, 0, 0, 0, 0, 0, -1))
    before = world.observe(())
    for action in np.resize(actions, (8, 7)):
        world.step(action)
    after = world.observe(())
    assert after["robot0_eef_pos"][0] - before["robot0_eef_pos"][0] > 0.02
    assert np.ptp(after["robot0_gripper_qpos"]) < 0.5 * np.ptp(before["robot0_gripper_qpos"])


def _missing(name: str) -> tuple[int | None, int | None]:
    """H and Q where the profile leaves them to the user."""
    unknown = load_profile(name).unknown()
    return (8 if "policy.horizon" in unknown else None, 4 if "policy.query_interval" in unknown else None)


@pytest.mark.parametrize("name", POSING)
def test_a_policy_whose_actions_are_poses_sends_the_hand_there(name: str, world: TinyWorld) -> None:
    seen: list[Any] = []
    with serve(name, seen.append) as address:
        policy = load_served(address, name)
        policy.reset(fakes.EPISODE)
        actions = policy.predict(fakes.observation(), fakes.query())
        policy.client.close()
    POSING[name](seen[0])
    assert len(seen) == 1
    assert len(actions) == policy.spec.query_interval == policy.spec.horizon == 30
    assert policy.spec.control == "absolute"
    assert np.allclose(actions, POSE, atol=1e-6)
    world.reset(0)
    for _ in range(8):
        world.step((0, 0, 0, 0, 0, 0, -1))
    world.set_control(policy.spec.control)
    for action in actions:
        world.step(action)
    after = world.observe(())
    assert after["robot0_eef_pos"] == pytest.approx(POSE[:3], abs=5e-3)
    assert np.ptp(after["robot0_gripper_qpos"]) < 2e-3


class Kept:
    """Keeps what it is asked."""

    def __init__(self, name: str) -> None:
        horizon, interval = (load_profile(name).get("policy", key) for key in ("horizon", "query_interval"))
        self.spec = PolicySpec(name, 8, 4) if horizon == "?" else PolicySpec(name, horizon, interval)
        self.asked: list[Any] = []

    def reset(self, episode: Any) -> None:
        pass

    def predict(self, observation: Any, query: Any) -> Any:
        self.asked.append((observation, query))
        return closing(self.spec.horizon)


@pytest.mark.parametrize("name", WRAPPED)
def test_an_adapter_behind_our_own_server_is_shown_what_its_profile_has_prepared(name: str) -> None:
    profile, policy = load_profile(name), Kept(name)
    observation = fakes.observation(profile.get("policy", "image_size"))
    request = Request(profile).build(observation, fakes.query(), fakes.EPISODE)
    host = Host(policy, "x")
    with host.open():
        reply = openpi.answer(host, unpack(pack(request, OPENPI), OPENPI))
    assert Reply(profile).read(reply, policy.spec.query_interval, policy.spec.horizon).shape[1] == 7
    ((seen, query),) = policy.asked
    CHECKS[name]({**request, "observation": seen})
    assert (query.seed, query.instruction) == (1234, request["prompt"])


@pytest.mark.parametrize("name", UNKNOWN)
def test_a_policy_whose_code_could_not_be_read_names_what_it_needs(name: str) -> None:
    with pytest.raises(AdapterError, match=r"not know .*inputs\.image\.steps.*actions\.steps"):
        load_served("openpi://127.0.0.1:1", name)


def test_every_other_profile_asks_as_a_tested_one() -> None:
    for name in set(profile_names()) - CHECKS.keys() - POSING.keys() - {*UNKNOWN, *ELSEWHERE}:
        tables = load_profile(name).tables
        tested = "openvla_oft" if name.startswith("openvla_oft") else "vla_eval"
        generic = load_profile(tested).tables
        assert {key: tables[key] for key in tables.keys() - TABLES_THAT_DIFFER} == {
            key: generic[key] for key in generic.keys() - TABLES_THAT_DIFFER
        }
