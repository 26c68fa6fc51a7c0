"""openpi's server and its client, each in another process."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients import transport
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from tests.conformance.policies import Sound
from tests.policies.clients import fakes
from tests.policies.clients.test_profiles_on_the_wire import check_pi05
from tests.policies.peers import clients
from tests.policies.peers.conftest import HERE, PYTHON, peer, require, shown


@pytest.fixture(autouse=True)
def _openpi() -> None:
    require("openpi.serving.websocket_policy_server")


def test_a_server_of_openpi_is_shown_what_its_policy_expects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "FIRST_PAUSE_S", 0.01)
    with peer("openpi_server.py", str(tmp_path)) as port:
        policy = load_served(f"openpi://127.0.0.1:{port}", "pi05_libero")
        policy.reset(fakes.EPISODE)
        answers = [policy.predict(fakes.observation(), fakes.query(index)) for index in range(2)]
        with pytest.raises(ServerError, match="'RuntimeError: out of memory'"):
            policy.predict(fakes.observation(), Query(2, 10, "fail", 0))
        answers.append(policy.predict(fakes.observation(), fakes.query(3)))
        policy.client.close()
    calls = shown(tmp_path)
    assert len(calls) == 3
    for call in calls:
        prompt = str(call.pop("prompt"))
        check_pi05({key.replace(".", "/"): value for key, value in call.items()} | {"prompt": prompt})
    for actions in answers:
        assert np.allclose(actions, np.tile([0, -1, -1, 0, 0, 0, 1], (10, 1)))


def test_its_client_is_served_as_in_process() -> None:
    with serving(Host(Sound(), "x"), port=0) as (port, _):
        command = [PYTHON, str(HERE / "clients.py"), "openpi", str(port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    expected = Sound().predict(clients.shown(), Query(0, 0, "do it", 5))
    for actions in json.loads(done.stdout):
        assert np.array(actions).tobytes() == expected.tobytes()
