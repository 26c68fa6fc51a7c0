"""Serving a policy: what comes out of the server is what comes out of the adapter."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from pytest_libero_max.cli import main
from pytest_libero_max.conformance.policy.subject import PolicySubject, observe
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination
from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients import transport
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.clients.served import RememberingPolicy, ServedPolicy
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.loading import forget_adapter
from pytest_libero_max.policies.server import sockets
from pytest_libero_max.policies.server.batching import Batching
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.metrics import Metrics
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.conformance.policies import Copied, Sound
from tests.policies.clients import fakes
from tests.policies.server.policies import Batched, Counting, at_once


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


def test_a_profile_that_prepares_what_is_shown_takes_from_the_adapter_what_it_alone_knows() -> None:
    class Prepared(Sound):
        def __init__(self) -> None:
            self.spec = PolicySpec("mine", 8, 4, revision="r1", repeatable=False, suites=("libero_goal",))
            self.keys: set[str] = set()

        def chunk(self, observation: Any, query: Any) -> Any:
            self.keys = set(observation)
            return np.zeros((8, 7))

    prepared = Prepared()
    with serving(Host(prepared, "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "wrapped", 8, 2)
        policy.reset(fakes.EPISODE)
        policy.predict(fakes.observation(), fakes.query())
        policy.client.close()
    spec = policy.spec
    assert prepared.keys == {"image", "wrist_image", "state"}
    assert (spec.name, spec.horizon, spec.query_interval, spec.image_size) == ("wrapped", 8, 2, 256)
    assert spec.revision is not None
    assert spec.revision.startswith("r1, profile wrapped ")
    assert (spec.repeatable, spec.suites, spec.control) == (False, ("libero_goal",), "delta")


def test_an_adapter_with_memory_keeps_it_behind_such_a_profile() -> None:
    with serving(Host(Counting(), "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "wrapped", 8, 4)
        assert isinstance(policy, RememberingPolicy)
        policy.reset(fakes.EPISODE)
        counts = [policy.predict(fakes.observation(), fakes.query())[0, 0] for _ in range(2)]
        memory = policy.snapshot()
        counts.append(policy.predict(fakes.observation(), fakes.query())[0, 0])
        policy.restore(memory)
        counts.append(policy.predict(fakes.observation(), fakes.query())[0, 0])
        policy.client.close()
    assert counts == pytest.approx([0.0, 0.01, 0.02, 0.02])


def test_h_and_q_of_the_server_may_be_overridden() -> None:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "served", None, 2)
        policy.reset(fakes.EPISODE)
        assert (policy.spec.horizon, policy.spec.query_interval) == (8, 2)
        shorter = load_served(f"openpi://127.0.0.1:{port}", "served", 4, 2)
        assert len(shorter.predict(fakes.observation(), fakes.query())) == 4
        policy.client.close()
        shorter.client.close()


def test_many_clients_get_their_own_answers_in_batches_too() -> None:
    batched = Batched()

    def play(number: int) -> tuple[bytes, set[int]]:
        policy = load_served(f"openpi://127.0.0.1:{port}", "served")
        policy.reset(fakes.EPISODE)
        answers, sizes = [], set()
        for index in range(5):
            answers.append(policy.predict(fakes.observation(), fakes.query(number + 10 * index)))
            sizes.add(policy.batch_size)
        policy.client.close()
        return b"".join(answer.tobytes() for answer in answers), sizes

    with serving(Host(batched, "x", Batching(2, 0.05)), port=0) as (port, _):
        results = at_once(*(lambda number=number: play(number) for number in range(2)))
    for number, (answers, _) in enumerate(results):
        expected = [Sound().predict(fakes.observation(), fakes.query(number + 10 * i)) for i in range(5)]
        assert answers == b"".join(answer.tobytes() for answer in expected)
    assert sum(batched.sizes) == 10
    assert set().union(*(sizes for _, sizes in results)) == set(batched.sizes)


def test_policies_with_memory_are_served_to_many_clients() -> None:
    with serving(Host(Counting(), "x"), port=0) as (port, _):
        clients = [load_served(f"openpi://127.0.0.1:{port}", "served") for _ in range(2)]
        seen: list[list[int]] = [[], []]
        memories: list[Any] = []

        def ask(number: int) -> None:
            client = clients[number]
            seen[number].append(round(100 * client.predict(fakes.observation(), fakes.query())[0, 0]))

        for client in clients:
            assert isinstance(client, RememberingPolicy)
            client.reset(fakes.EPISODE)
        for number in (0, 1, 0, 0):
            ask(number)
        memories.append(clients[0].snapshot())  # type: ignore[attr-defined]  # looked above
        for number in (0, 1, 0, 0):
            ask(number)
        clients[0].reset(fakes.EPISODE)
        ask(0)
        clients[0].restore(memories[0])  # type: ignore[attr-defined]
        clients[0].client.close()  # a new connection finds the memory again
        ask(0)
        for client in clients:
            client.client.close()
    assert seen == [[0, 1, 2, 3, 4, 5, 0, 3], [0, 1]]


@pytest.mark.parametrize("kind", [Batched, Copied])
def test_a_sound_policy_is_as_sound_behind_a_server(kind: type[Sound]) -> None:
    policy, world = kind(), TinyWorld()
    policy.spec = PolicySpec("sound", 8, 4, image_size=32)
    with served(policy) as client:
        subject = PolicySubject(client, observe(client, world))
        outcomes = Examination(lambda: subject, rules_for("policy")).outcomes()
    world.close()
    # What may be broken is about what is sent: images as they are delivered, which the adapter turns.
    assert not [outcome for outcome in outcomes if outcome.fails]
    assert {outcome.rule.id: outcome.state for outcome in outcomes}["policy/memory/declared"] == "kept"


def test_a_memory_that_is_not_copied_is_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    with serving(Host(Counting(), "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}?patience=0.2", "served")
        assert isinstance(policy, RememberingPolicy)
        policy.reset(fakes.EPISODE)
        policy.predict(fakes.observation(), fakes.query())
        copied = policy.snapshot()
        name = copied.name  # type: ignore[attr-defined]
        del copied
        for _ in range(3):
            policy.predict(fakes.observation(), fakes.query())
        policy.restore(type(policy.snapshot())(name))  # type: ignore[call-arg]
        with pytest.raises(ServerError, match=r"memory .* not here"):
            policy.predict(fakes.observation(), fakes.query())
        with pytest.raises(AdapterError, match="what snapshot"):
            policy.restore(None)
        policy.client.close()


def test_a_server_with_a_token_answers_those_who_know_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    monkeypatch.delenv("LIBERO_MAX_SERVER_TOKEN", raising=False)

    def connect(token: str | None) -> None:
        if token is not None:
            monkeypatch.setenv("LIBERO_MAX_SERVER_TOKEN", token)
        load_served(f"openpi://127.0.0.1:{port}?patience=0.02", "served").client.close()

    def status(path: str, token: str | None = None) -> int:
        header = {} if token is None else {"Authorization": f"Bearer {token}"}
        try:
            with urllib.request.urlopen(
                urllib.request.Request(f"http://127.0.0.1:{port}{path}", headers=header), timeout=5
            ) as response:
                return int(response.status)
        except urllib.error.HTTPError as error:
            return error.code

    with serving(Host(Sound(), "x"), port=0, token="s\u00e9cret") as (port, _):
        for wrong in (None, "secret"):
            with pytest.raises(ServerError, match="401"):
                connect(wrong)
        assert [status("/health"), status("/metrics"), status("/metrics", "wrong")] == [200, 401, 401]
    with serving(Host(Sound(), "x"), port=0, token="secret") as (port, _):
        connect("secret")
        assert [status("/metrics", "secret"), status("/other", "secret")] == [501, 404]


def test_the_metrics_have_a_page() -> None:
    pytest.importorskip("prometheus_client", reason="the extra 'metrics' has it")
    with serving(Host(Sound(), "x", metrics=Metrics()), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}", "served")
        policy.reset(fakes.EPISODE)
        policy.predict(fakes.observation(), fakes.query())
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as response:
            assert response.headers["Content-Type"].startswith("text/plain; version=")
            text = response.read().decode()
        policy.client.close()
    assert "libero_max_latency_seconds_count 1.0" in text
    assert "libero_max_clients 1.0" in text


def test_an_error_of_the_policy_reaches_the_client(monkeypatch: pytest.MonkeyPatch) -> None:
    class Raising(Sound):
        def chunk(self, observation: Any, query: Any) -> Any:
            raise RuntimeError("out of memory")

    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    with (
        served(Raising()) as policy,
        pytest.raises(ServerError, match=r"AdapterError: .*RuntimeError in predict"),
    ):
        policy.predict(fakes.observation(), fakes.query())


def test_the_server_says_that_it_is_there() -> None:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        for path in sockets.HEALTH:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=5) as response:
                assert (response.status, response.read()) == (200, b"OK\n")


def test_a_port_in_use_is_said_so() -> None:
    with (
        serving(Host(Sound(), "x"), port=0) as (port, _),
        pytest.raises(ServerError, match=f"cannot listen at 127.0.0.1:{port}.*another --port"),
        serving(Host(Sound(), "x"), port=port),
    ):
        pass


def test_the_command_prints_how_to_play_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    adapter = tmp_path / "adapter.py"
    adapter.write_text("from tests.conformance.policies import Sound\npolicy = Sound\n")
    asked: list[Any] = []
    real: Callable[..., Any] = sockets.serving

    @contextmanager
    def for_a_moment(server: Host, name: str, port: int, token: str | None) -> Iterator[Any]:
        with real(server, name, port, token) as (found, never):
            policy = load_served(f"openpi://127.0.0.1:{found}", "served")
            asked.append(policy.spec)
            policy.client.close()
            never.set()
            yield found, never

    monkeypatch.setattr(sockets, "serving", for_a_moment)
    assert main(["serve", str(adapter), "--port=0", "--query-interval=2"]) == 0
    assert asked[0].query_interval == 2
    assert asked[0].revision.startswith("adapter ")
    out = capsys.readouterr().out
    assert "--libero-max-profile=served" in out
    assert main(["serve", "openpi://127.0.0.1:1"]) == 1
    assert "is a server already" in capsys.readouterr().err


def test_a_page_in_a_browser_is_no_client() -> None:
    page = {"Origin": "http://example.com"}
    refused = pytest.raises(InvalidStatus, match="403")
    with serving(Host(Sound(), "adapter abc"), port=0) as (port, _), refused:
        connect(f"ws://127.0.0.1:{port}", additional_headers=page, proxy=None)
