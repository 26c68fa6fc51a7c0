from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients import transport
from pytest_libero_max.policies.clients.codecs import VLA_EVAL, pack
from pytest_libero_max.policies.clients.opening import load_served, parse_address
from pytest_libero_max.policies.clients.protocols.http import _reply
from pytest_libero_max.policies.clients.protocols.vla_eval import VlaEvalLink, returns_poses, wanted
from pytest_libero_max.policies.clients.served import ServedPolicy
from pytest_libero_max.policies.server.vla_eval import quaternion
from tests.policies.clients import fakes
from tests.policies.clients.test_profiles_on_the_wire import AXIS_ANGLE, SHORT, is_state

CHUNK = np.arange(70.0).reshape(10, 7) / 100


def connect(port: int, profile: str = "vla_eval_pi05") -> ServedPolicy:
    policy = load_served(f"vla-eval://127.0.0.1:{port}?patience=1", profile)
    policy.reset(fakes.EPISODE)
    return policy


class Model:
    """Returns a chunk that counts its calls in the first column."""

    def __init__(self) -> None:
        self.seen: list[Any] = []
        self.episodes: list[Any] = []

    def __call__(self, request: Any) -> Any:
        if "episode_start" in request:
            self.episodes.append(request["episode_start"])
            return None
        self.seen.append(request)
        actions = CHUNK.copy()
        actions[:, 0] = len(self.seen)
        return actions


@pytest.mark.parametrize(("buffered", "count"), [(8, 5), (10, 5), (None, 10)])
def test_one_query_is_one_call_of_the_model_with_the_server_keeping_the_chunk_or_not(
    buffered: int | None, count: int
) -> None:
    model = Model()
    with fakes.vla_eval(model, buffered) as port:
        policy = connect(port)
        first = policy.predict(fakes.observation(), fakes.query(0))
        second = policy.predict(fakes.observation(), fakes.query(1))
        policy.client.close()
    assert first.shape == (count, 7)
    assert (first[:, 0] == 1).all()
    assert (second[:, 0] == 2).all()
    assert np.allclose(first[:, 1:6], CHUNK[:count, 1:6])
    assert model.episodes[0]["task"] == {
        "name": fakes.EPISODE.instruction,
        "suite": "libero_spatial",
        "task_id": 3,
    }
    assert len(model.episodes) == 2


@pytest.mark.parametrize("buffered", [8, None])
def test_another_cadence_gets_the_actions_that_it_needs(buffered: int | None) -> None:
    model = Model()
    with fakes.vla_eval(model, buffered) as port:
        policy = connect(port)
        policy.spec = replace(policy.spec, query_interval=8)
        assert len(policy.predict(fakes.observation(), fakes.query())) >= 8
        policy.client.close()
    assert len(model.seen) == 1


@pytest.mark.parametrize(
    ("wants", "keys", "cameras"),
    [
        ({}, {"images", "task_description"}, ("agentview",)),
        ({"send_wrist_image": True}, {"images", "task_description"}, ("agentview", "robot0_eye_in_hand")),
        (
            {"send_state": True},
            {"images", "task_description", "states", "controller_states"},
            ("agentview",),
        ),
    ],
)
def test_the_server_gets_what_it_asks_for_and_nothing_else_is_rendered(
    wants: dict[str, Any], keys: set[str], cameras: tuple[str, ...]
) -> None:
    model = Model()
    with fakes.vla_eval(model, None, {"observation_params": wants}) as port:
        policy = connect(port)
        policy.predict(fakes.observation(), fakes.query())
        policy.client.close()
    assert model.seen[0].keys() == keys
    assert policy.spec.cameras == cameras
    assert ("wrist" in model.seen[0]["images"]) == ("robot0_eye_in_hand" in cameras)


@pytest.mark.parametrize(("kept", "rotation"), [(True, AXIS_ANGLE), (False, SHORT)])
def test_the_sign_of_the_quaternion_is_kept_where_the_server_asks_for_that(kept: bool, rotation: Any) -> None:
    model = Model()
    wants = {"send_state": True, "quat_no_antipodal": kept}
    with fakes.vla_eval(model, None, {"observation_params": wants}) as port:
        policy = connect(port)
        policy.predict(fakes.observation(), fakes.query())
        policy.client.close()
    assert is_state(model.seen[0]["states"], rotation)


@pytest.mark.parametrize(
    ("greeting", "profile", "control"),
    [
        ({"observation_params": {"absolute_action": True}}, "vla_eval_pi05", "absolute"),
        ({"action_spec": {"position": {"format": "absolute_xyz"}}}, "vla_eval_pi05", "absolute"),
        ({"action_spec": {"position": {"format": "delta_xyz"}}}, "vla_eval_pi05", "delta"),
        ({}, "vla_eval_xvla", "absolute"),
    ],
)
def test_a_server_that_asks_for_it_is_played_under_absolute_control(
    greeting: dict[str, Any], profile: str, control: str
) -> None:
    with fakes.vla_eval(Model(), None, greeting) as port:
        policy = connect(port, profile)
        policy.client.close()
    assert policy.spec.control == control


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ({"action_spec": {"gripper": {"format": "continuous_01"}}}, "format 'continuous_01'"),
    ],
)
def test_actions_that_cannot_be_played_are_refused_when_the_server_greets(
    greeting: dict[str, Any], message: str
) -> None:
    with fakes.vla_eval(Model(), None, greeting) as port, pytest.raises(AdapterError, match=message):
        connect(port)


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ({"protocol_version": 2}, "speaks version 2"),
        ({"observation_params": [1]}, "'observation_params' are a list, but must be a map"),
    ],
)
def test_a_greeting_that_is_not_understood_is_an_error_of_the_server(
    greeting: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    with fakes.vla_eval(Model(), None, greeting) as port, pytest.raises(ServerError, match=message):
        connect(port)


def test_an_error_of_the_model_is_told_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    with fakes.vla_eval(lambda request: "observation_failed: KeyError: 'wrist'") as port:
        policy = connect(port)
        with pytest.raises(ServerError, match="observation_failed: KeyError: 'wrist'"):
            policy.predict(fakes.observation(), fakes.query())
        policy.client.close()


@pytest.mark.parametrize(
    "greeting",
    [
        {"observation_params": np.zeros(2)},
        {"action_spec": np.zeros(0)},
        {"capabilities": {"memory": np.zeros(2)}},
        {"observation_params": {"send_state": np.zeros(2)}},
        {"observation_params": {"absolute_action": np.ones(2)}},
        {"action_spec": {"gripper": {"format": np.zeros(2)}}},
        {"action_spec": {"position": {"format": ["absolute_xyz"]}}},
    ],
)
def test_arrays_and_lists_where_words_belong_are_an_error_of_the_server(greeting: Any) -> None:
    layout = {"observation": {"images": {}, "states": "$state"}}
    with pytest.raises(ServerError, match="the greeting"):
        returns_poses(greeting) or wanted(layout, greeting)


def test_a_profile_without_an_observation_is_refused() -> None:
    with pytest.raises(AdapterError, match="lacks an 'observation'"):
        wanted({"task": {}}, {})


@pytest.mark.parametrize("name", ["type", "seq"])
def test_an_array_in_the_envelope_is_an_error_of_the_server(name: str) -> None:
    linked = VlaEvalLink(parse_address("vla-eval://127.0.0.1:1"))
    message = {"type": "hello", "seq": 1, "payload": {}, name: np.arange(3)}
    linked.receive = lambda awaited="": pack(message, VLA_EVAL)  # type: ignore[method-assign]
    with pytest.raises(ServerError, match="was expected"):
        linked._read("hello", 1)


def test_an_axis_angle_that_is_too_large_is_an_error_of_the_client() -> None:
    with pytest.raises(ServerError, match="is no number"):
        quaternion(np.array([1e300, 1e300, 0.0]))


def test_half_a_character_in_a_reply_in_a_reply_is_an_error_of_the_server() -> None:
    with pytest.raises(ServerError, match="no JSON document"):
        _reply(b'"[\\ud800"')
