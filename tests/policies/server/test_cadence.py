"""What a request says beside the query: the cadence that is played, and steps without a query."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError, ServerError
from pytest_libero_max.policies.clients.messages import Request
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.profile import load_profile
from pytest_libero_max.policies.server import openpi
from pytest_libero_max.policies.server.batching import Batching
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from tests.conformance.policies import Sound
from tests.policies.clients import fakes
from tests.policies.server.policies import Batched, at_once

REQUEST = Request(load_profile("served")).build(fakes.observation(), fakes.query(), fakes.EPISODE)
"""A query as a server gets it."""


@pytest.mark.parametrize("profile", ["served", "wrapped"])
def test_a_server_that_is_connected_to_again_is_the_same_one_at_any_cadence(profile: str) -> None:
    class Seeded(Sound):
        def chunk(self, observation: Any, query: Any) -> Any:
            return np.random.default_rng(query.seed).uniform(-0.8, 0.8, (8, 7))

    with serving(Host(Seeded(), "x"), port=0) as (port, _):
        policy = load_served(f"openpi://127.0.0.1:{port}?patience=0.2", profile, 8, 4)
        policy.reset(fakes.EPISODE)
        first = policy.predict(fakes.observation(), fakes.query())
        own = policy.spec
        for spec in (own, replace(own, horizon=6, query_interval=6), own):
            policy.spec = spec
            policy.client.close()
            again = policy.predict(fakes.observation(), fakes.query())
            assert again.tobytes() == first[: spec.horizon].tobytes()
            assert policy.spec == spec
        policy.client.close()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frames": [1]}, r"Expected `object`, got `int` - at `\$.frames\[0\]`"),
        ({"frames": 7}, r"Expected `array`, got `int` - at `\$.frames`"),
        ({"frames": [{"observation": {"x": "text"}, "step": 0}]}, "Expected `numpy.ndarray`, got `str`"),
        ({"frames": [{"observation": {}, "step": 0.5}]}, "Expected `int`, got `float`"),
        ({"cadence": [4]}, "Expected `array` of length 2"),
        ({"cadence": [4, 2.5]}, r"Expected `int`, got `float` - at `\$.cadence\[1\]`"),
    ],
)
def test_damaged_frames_and_cadences_are_refused(change: Any, message: str) -> None:
    host = Host(Sound(), "x")
    with host.open(), pytest.raises(ServerError, match=message):
        openpi.answer(host, {**REQUEST, **change})


def test_a_cadence_that_breaks_a_rule_is_an_error_of_its_question() -> None:
    host = Host(Sound(), "x")
    with host.open():
        with pytest.raises(AdapterError, match="query_interval=5 > horizon=4"):
            openpi.answer(host, {**REQUEST, "cadence": [4, 5]})
        assert openpi.answer(host, REQUEST)["actions"].shape == (8, 7)


class AsDeclared(Batched):
    """What it returns depends on the H that it declares: a decoder of chunks of any length."""

    def chunk(self, observation: Any, query: Any) -> Any:
        return np.full((self.spec.horizon, 7), self.spec.horizon / 100 + self.spec.query_interval / 1000)


@pytest.mark.parametrize("size", [1, 2])
def test_an_adapter_that_reads_its_cadence_follows_that_of_each_client(size: int) -> None:
    host = Host(AsDeclared(), "x", Batching(size, 0.05))
    with serving(host, port=0) as (port, _):
        clients = [load_served(f"openpi://127.0.0.1:{port}?patience=0.2", "served") for _ in range(2)]
        for client in clients:
            client.reset(fakes.EPISODE)
        for cadence in ((8, 4), (2, 2), (6, 1)):
            clients[1].spec = replace(clients[1].spec, horizon=cadence[0], query_interval=cadence[1])
            answers = at_once(
                *(
                    lambda client=client: client.predict(fakes.observation(), fakes.query())
                    for client in clients
                )
            )
            for answer, (horizon, interval) in zip(answers, ((8, 4), cadence), strict=True):
                assert answer.shape == (horizon, 7)
                assert np.allclose(answer, horizon / 100 + interval / 1000)
        for client in clients:
            client.client.close()
    assert host.spec.horizon == 8
