"""Serving a policy: what comes out of the server is what comes out of the adapter."""

from __future__ import annotations

import threading
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max.cli import main
from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.loading import forget_adapter
from pytest_libero_max.policies.servers import host, link
from pytest_libero_max.policies.servers.codecs import OPENPI, pack, unpack
from pytest_libero_max.policies.servers.host import Host, declared_spec, serving
from pytest_libero_max.policies.servers.served import ServedPolicy, load_served
from tests.policies.servers import fakes
from tests.policies.test_examination import Copied, Sound


@pytest.fixture(autouse=True)
def _adapters_are_forgotten() -> Iterator[None]:
    yield
    forget_adapter()


@contextmanager
def served(policy: Any) -> Iterator[ServedPolicy]:
    with serving(Host(policy, "adapter abc"), port=0) as (port, _):
        client = load_served(f"openpi://127.0.0.1:{port}?patience=0.2", "served")
        client.reset(fakes.EPISODE)
        yield client
        client.client.close()


def test_a_served_policy_answers_as_it_does_in_process() -> None:
    direct = Sound()
    with served(Sound()) as policy:
        assert policy.spec == PolicySpec(**{**direct.spec.to_dict(), "revision": "adapter abc"})
        for index in range(3):
            given_, asked = fakes.observation(), fakes.query(index)
            answer = policy.predict(given_, asked)
            assert answer.tobytes() == direct.predict(given_, asked).tobytes()


def test_it_is_told_each_episode_once_and_sees_only_the_images_that_it_wants() -> None:
    class Told(Sound):
        def __init__(self) -> None:
            self.spec = PolicySpec("told", 8, 4, cameras=("robot0_eye_in_hand",), image_size=64)
            self.episodes: list[Any] = []
            self.keys: set[str] = set()

        def reset(self, episode: Any) -> None:
            self.episodes.append(episode)

        def chunk(self, observation: Any, query: Any) -> Any:
            self.keys = set(observation)
            return np.zeros((8, 7))

    told = Told()
    with served(told) as policy:
        assert policy.spec.cameras == ("robot0_eye_in_hand",)
        policy.predict(fakes.observation(), fakes.query(0))
        policy.predict(fakes.observation(), fakes.query(1))
    assert told.episodes == [fakes.EPISODE]
    assert told.keys == fakes.observation().keys() - {"agentview_image"}


def test_h_and_q_of_the_server_may_be_overridden() -> None:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "served", None, 2)
        policy.reset(fakes.EPISODE)
        assert (policy.spec.horizon, policy.spec.query_interval) == (8, 2)
        shorter = load_served(f"openpi://127.0.0.1:{port}", "served", 4, 2)
        assert len(shorter.predict(fakes.observation(), fakes.query())) == 4
        policy.client.close()
        shorter.client.close()


def test_the_suites_of_an_adapter_are_declared_through_the_server() -> None:
    some = Sound()
    some.spec = PolicySpec("some", 8, 4, suites=("libero_goal",))
    with served(some) as policy:
        assert policy.spec.suites == ("libero_goal",)


def test_many_clients_get_their_own_answers() -> None:
    results: dict[int, bytes] = {}

    def play(number: int, port: int) -> None:
        policy = load_served(f"openpi://127.0.0.1:{port}", "served")
        policy.reset(fakes.EPISODE)
        answers = [policy.predict(fakes.observation(), fakes.query(number + 10 * i)) for i in range(5)]
        results[number] = b"".join(answer.tobytes() for answer in answers)
        policy.client.close()

    with serving(Host(Sound(), "x"), port=0) as (port, _):
        threads = [threading.Thread(target=play, args=(number, port)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for number, answers in results.items():
        expected = [Sound().predict(fakes.observation(), fakes.query(number + 10 * i)) for i in range(5)]
        assert answers == b"".join(answer.tobytes() for answer in expected)
    assert len(results) == 4


def test_an_error_of_the_policy_reaches_the_client(monkeypatch: pytest.MonkeyPatch) -> None:
    class Raising(Sound):
        def chunk(self, observation: Any, query: Any) -> Any:
            raise RuntimeError("out of memory")

    monkeypatch.setattr(link, "FIRST_PAUSE_S", 0.01)
    with (
        served(Raising()) as policy,
        pytest.raises(
            ServerError, match=r"reports an error: .*AdapterError: .*RuntimeError in predict.*out of"
        ),
    ):
        policy.predict(fakes.observation(), fakes.query())


def test_the_server_says_that_it_is_there() -> None:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        for path in host.HEALTH:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as response:
                assert (response.status, response.read()) == (200, b"OK\n")


def test_policies_that_cannot_be_shared_are_refused() -> None:
    with pytest.raises(AdapterError, match="has a memory"):
        Host(Copied(), "x")
    privileged = Sound()
    privileged.spec = PolicySpec("privileged", privileged=True)
    with pytest.raises(AdapterError, match="reads the simulator"):
        Host(privileged, "x")


def test_a_port_in_use_is_said_so() -> None:
    with (
        serving(Host(Sound(), "x"), port=0) as (port, _),
        pytest.raises(ServerError, match=f"cannot listen at 127.0.0.1:{port}.*another --port"),
        serving(Host(Sound(), "x"), port=port),
    ):
        pass


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ({}, "declares no spec"),
        ({"spec": {"name": "x"}}, "declares no spec"),
        ({"spec": {**PolicySpec("x").to_dict(), "horizon": 0}}, "cannot be used"),
    ],
)
def test_another_server_is_not_taken_for_one(greeting: Any, message: str) -> None:
    with pytest.raises(ServerError, match=message):
        declared_spec(greeting)


REQUEST = unpack(
    pack(
        {
            "prompt": "x",
            "observation": {"robot0_eef_pos": np.zeros(3)},
            "query": {"index": 0, "step": 0, "seed": 1},
            "episode": {"suite": "s", "task_index": 0, "instruction": "x", "seed": 1, "max_steps": 10},
        },
        OPENPI,
    ),
    OPENPI,
)
VALUES = st.none() | st.integers(-5, 5) | st.text("ab", max_size=3) | st.lists(st.integers(), max_size=2)


@given(
    st.sampled_from(sorted(REQUEST)), VALUES, st.dictionaries(st.text("ab", max_size=2), VALUES, max_size=2)
)
@settings(max_examples=60)
def test_any_request_is_answered_or_refused(key: str, value: Any, more: Any) -> None:
    class Constant(Sound):
        def chunk(self, observation: Any, query: Any) -> Any:
            return np.zeros((8, 7))

    server = Host(Constant(), "x")
    for request in (value, {**REQUEST, key: value}, {**REQUEST, key: more}, more):
        with suppress(ServerError):
            assert server.answer(request)["actions"].shape == (8, 7)


@given(st.binary(max_size=60))
@settings(max_examples=30, deadline=None)
def test_any_bytes_on_the_wire_leave_the_server_standing(content: bytes) -> None:
    from websockets.sync.client import connect

    with connect(f"ws://127.0.0.1:{_standing()}", compression=None, proxy=None) as connection:
        connection.recv(timeout=5)
        connection.send(content)
        answer = connection.recv(timeout=5)
    assert isinstance(answer, str)
    assert answer.startswith("ServerError: ")


_STANDING: list[int] = []


def _standing() -> int:
    return _STANDING[0]


@pytest.fixture(autouse=True, scope="module")
def _one_server() -> Iterator[None]:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        _STANDING.append(port)
        yield
        _STANDING.clear()


def test_the_command_prints_how_to_play_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    adapter = tmp_path / "adapter.py"
    adapter.write_text("from tests.policies.test_examination import Sound\npolicy = Sound\n")
    asked: list[Any] = []
    real: Callable[..., Any] = host.serving

    @contextmanager
    def for_a_moment(server: Host, name: str, port: int) -> Iterator[Any]:
        with real(server, name, port) as (found, never):
            policy = load_served(f"openpi://127.0.0.1:{found}", "served")
            asked.append(policy.spec)
            policy.client.close()
            never.set()
            yield found, never

    monkeypatch.setattr(host, "serving", for_a_moment)
    assert main(["serve", str(adapter), "--port=0", "--query-interval=2"]) == 0
    assert asked[0].query_interval == 2
    assert asked[0].revision.startswith("adapter ")
    out = capsys.readouterr().out
    assert "--libero-max-profile=served" in out
    assert main(["serve", "openpi://127.0.0.1:1"]) == 1
    assert "is a server already" in capsys.readouterr().err
