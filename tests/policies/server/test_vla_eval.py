from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients.codecs import VLA_EVAL, pack, unpack
from pytest_libero_max.policies.clients.protocols.vla_eval import returns_poses, wanted
from pytest_libero_max.policies.contract import PolicySpec, query_seed
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.vla_eval import WITH_IMAGES, Session, quaternion
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.policies.transforms.states import axis_angle
from tests.conformance.policies import Sound
from tests.policies.clients import fakes
from tests.policies.server.policies import Counting

TASK = {"task": {"name": "x", "suite": "libero_goal", "task_id": 4, "episode_idx": 7}}


class Told(Sound):
    """Keeps what it is told and shown; its actions count its answers."""

    def __init__(self, **spec: Any) -> None:
        self.spec = PolicySpec("told", 8, 3, **spec)
        self.episodes: list[Any] = []
        self.queries: list[Any] = []
        self.observations: list[Any] = []

    def reset(self, episode: Any) -> None:
        self.episodes.append(episode)

    def predict(self, observation: Any, query: Any) -> Any:
        self.queries.append(query)
        self.observations.append(observation)
        return np.full((8, 7), len(self.queries) / 100)


@contextmanager
def session(policy: Any) -> Iterator[Session]:
    host = Host(policy, "x")
    with host.open():
        yield Session(host)


def shown() -> dict[str, Any]:
    seen = fakes.observation()
    return {
        "images": {
            "agentview": rotate_180(seen["agentview_image"]),
            "wrist": rotate_180(seen["robot0_eye_in_hand_image"]),
        },
        "task_description": "do it",
        "states": np.concatenate(
            [seen["robot0_eef_pos"], axis_angle(seen["robot0_eef_quat"]), seen["robot0_gripper_qpos"]]
        ),
    }


def act(talk: Session, payload: Any = None) -> Any:
    answer = talk.reply("observation", shown() if payload is None else payload)
    assert answer is not None
    assert answer[0] == "action"
    return answer[1]["actions"]


def test_the_policy_sees_what_the_world_would_deliver() -> None:
    policy, seen = Told(), fakes.observation()
    with session(policy) as talk:
        assert talk.reply("episode_start", TASK) is None
        assert act(talk).shape == (7,)
    observation = policy.observations[0]
    assert observation.keys() == {
        "agentview_image",
        "robot0_eye_in_hand_image",
        "robot0_eef_pos",
        "robot0_eef_quat",
        "robot0_gripper_qpos",
    }
    for key, value in observation.items():
        np.testing.assert_allclose(value, seen[key], atol=1e-12)
    episode = policy.episodes[0]
    assert (episode.suite, episode.task_index, episode.seed, episode.max_steps) == ("libero_goal", 4, 7, 300)


def test_q_actions_are_handed_out_one_by_one_and_seeds_depend_on_the_query_alone() -> None:
    policy = Told()
    with session(policy) as talk:
        for _ in range(2):
            talk.reply("episode_start", TASK)
            numbers = [float(act(talk)[0]) for _ in range(5)]
            talk.reply("episode_end", {"success": True})
    assert numbers == [0.03, 0.03, 0.03, 0.04, 0.04]
    assert [(query.index, query.step) for query in policy.queries] == [(0, 0), (1, 3)] * 2
    assert [query.seed for query in policy.queries] == [query_seed(7, 0), query_seed(7, 1)] * 2
    assert {query.instruction for query in policy.queries} == {"do it"}


def test_a_seed_that_comes_with_the_observation_is_taken() -> None:
    policy = Told()
    with session(policy) as talk:
        talk.reply("episode_start", TASK)
        act(talk, {**shown(), "seed": 99})
    assert policy.queries[0].seed == 99


def test_the_memory_lasts_for_the_episode_of_the_connection() -> None:
    host = Host(Counting(), "x")
    with host.open():
        one, other = Session(host), Session(host)
        seen: list[float] = []
        for talk in (one, other):
            talk.reply("episode_start", TASK)
        for talk in [one] * 6 + [other] * 4 + [one] * 2:
            seen.append(float(act(talk)[0]))
        one.reply("episode_start", TASK)
        seen.append(float(act(one)[0]))
    assert seen == [0.0] * 4 + [0.01] * 2 + [0.0] * 4 + [0.01] * 2 + [0.0]


def test_the_greeting_of_a_policy_of_poses_asks_for_absolute_control() -> None:
    with session(Told(control="absolute")) as talk:
        answer = talk.reply("hello", {})
    assert answer is not None
    assert returns_poses(answer[1])


def test_the_greeting_asks_for_what_the_policy_wants() -> None:
    with session(Told(cameras=("agentview",))) as talk:
        answer = talk.reply("hello", {})
    assert answer is not None
    greeting = answer[1]
    assert greeting["observation_params"] == {
        "send_wrist_image": False,
        "send_state": True,
        "quat_no_antipodal": True,
    }
    with (
        session(Counting()) as talk,
        pytest.raises(AdapterError, match="has a memory"),
    ):
        wanted({"observation": {}}, talk.greeting())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"images": {}}, r"images\['agentview'\] is not there"),
        ({"images": {"agentview": np.zeros((64, 64, 3), np.uint8)}}, r"is uint8 \(64, 64, 3\), but .*256"),
        ({"states": np.zeros(7)}, "eight finite numbers"),
        ({"states": np.full(8, np.nan)}, "eight finite numbers"),
        ({"seed": 0.5}, "where an integer belongs"),
    ],
)
def test_an_observation_that_cannot_be_shown_is_refused(change: Any, message: str) -> None:
    with session(Told()) as talk:
        talk.reply("episode_start", TASK)
        with pytest.raises(ServerError, match=message):
            talk.reply("observation", {**shown(), **change})
        assert act(talk).shape == (7,)


@pytest.mark.parametrize(
    ("kind", "message"), [("observation", "before any episode_start"), ("dance", "unknown type 'dance'")]
)
def test_a_message_out_of_turn_is_refused(kind: str, message: str) -> None:
    with session(Told()) as talk, pytest.raises(ServerError, match=message):
        talk.reply(kind, {})


@pytest.mark.parametrize("kind", ["png", "jpeg", "raw"])
def test_images_come_as_files_as_well(kind: str) -> None:
    image = np.full((8, 6, 3), (200, 100, 50), dtype=np.uint8)
    data = image.tobytes()
    if kind != "raw":
        content = io.BytesIO()
        Image.fromarray(image).save(content, format=kind, quality=95)
        data = content.getvalue()
    sent = {"__image__": True, "format": kind, "data": data, "shape": [8, 6, 3], "dtype": "|u1"}
    found = unpack(pack({"image": sent}, VLA_EVAL), WITH_IMAGES)["image"]
    assert found.dtype == np.uint8
    assert np.abs(found.astype(int) - image).max() <= (2 if kind == "jpeg" else 0)


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        ({"format": "gif", "data": b""}, "format 'gif'"),
        ({"format": "png", "data": b"GIF89a"}, "cannot be read"),
        ({"format": "png", "data": "text"}, "format 'png'"),
        ({"format": "raw", "data": b"x", "dtype": "|u1", "shape": [9]}, "1 byte"),
    ],
)
def test_files_that_are_no_images_are_refused(sent: Any, message: str) -> None:
    with pytest.raises(ServerError, match=message):
        unpack(pack({"__image__": True, **sent}, VLA_EVAL), WITH_IMAGES)


def test_a_small_file_of_a_huge_image_is_not_decoded() -> None:
    content = io.BytesIO()
    Image.new("1", (5000, 5000)).save(content, format="png")
    with pytest.raises(ServerError, match="5000 x 5000 pixels"):
        unpack(pack({"__image__": True, "format": "png", "data": content.getvalue()}, VLA_EVAL), WITH_IMAGES)


def test_a_quaternion_comes_back_with_its_sign() -> None:
    generator = np.random.default_rng(0)
    for values in [*generator.normal(size=(20, 4)), np.array([0.0, 0.0, 0.0, 1.0])]:
        unit = values / np.linalg.norm(values)
        np.testing.assert_allclose(quaternion(axis_angle(unit)), unit, atol=1e-12)
