"""vla-eval's own model server and its own client, in another process."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from tests.conformance.policies import Sound
from tests.policies.clients import fakes
from tests.policies.clients.test_profiles_on_the_wire import QUARTER_TURN, check_vla_eval, is_turned
from tests.policies.peers.conftest import HERE, PYTHON, nested, peer, require, shown


@pytest.fixture(autouse=True)
def _vla_eval() -> None:
    require("vla_eval")


@pytest.mark.parametrize(("chunk", "count"), [(8, 5), (0, 10)])
def test_its_server_gets_what_libero_shows_and_one_query_is_one_call(
    chunk: int, count: int, tmp_path: Path
) -> None:
    with peer("vla_eval_server.py", "reach", str(chunk), str(tmp_path)) as port:
        policy = load_served(f"vla-eval://127.0.0.1:{port}", "vla_eval_pi05")
        policy.reset(fakes.EPISODE)
        answers = [policy.predict(fakes.observation(), fakes.query(index)) for index in range(3)]
        policy.client.close()
    calls = shown(tmp_path)
    assert len(calls) == 3
    check_vla_eval(nested(calls[0]))
    for actions in answers:
        assert actions.shape == (count, 7)
        assert np.allclose(actions, [0, -1, -1, 0, 0, 0, 1])


def test_its_server_of_x_vla_is_shown_what_x_vla_knows_and_its_poses_arrive(tmp_path: Path) -> None:
    require("torch")
    with peer("vla_eval_server.py", "xvla", "30", str(tmp_path)) as port:
        policy = load_served(f"vla-eval://127.0.0.1:{port}", "vla_eval_xvla")
        policy.reset(fakes.EPISODE)
        answers = [policy.predict(fakes.observation(), fakes.query(index)) for index in range(2)]
        policy.client.close()
    assert policy.spec.control == "absolute"
    # Columns y and z: a third of a turn about (1, 1, 1). The gripper closes.
    pose = [0.15, -0.25, 0.65, *(2 * np.pi / 3 / np.sqrt(3) * np.ones(3)), 1.0]
    for actions in answers:
        assert actions.shape == (30, 7)
        assert np.allclose(actions, pose, atol=1e-6)
    calls = shown(tmp_path)
    assert len(calls) == 2
    matrix = Rotation.from_quat([0.64, 0.288, 0.384, -0.6]).as_matrix() @ QUARTER_TURN
    for call in calls:  # also the second: no memory of the first
        assert is_turned(call["scene"], 0, 256)
        assert is_turned(call["wrist"][::-1, ::-1], 1, 256)
        assert str(call["language"]) == fakes.EPISODE.instruction
        assert call["domain_id"].tolist() == [3]
        assert np.allclose(call["proprio"][0, :9], [0.1, 0.2, 0.9, *matrix[:, 0], *matrix[:, 1]], atol=1e-6)
        assert not call["proprio"][0, 9:].any()


def test_its_client_is_served_as_in_process() -> None:
    own = Sound()
    own.spec = PolicySpec("own", 8, 3, image_size=32)
    with serving(Host(own, "x"), port=0) as (port, _):
        command = [PYTHON, str(HERE / "clients.py"), "vla-eval", str(port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    actions = np.array(json.loads(done.stdout))
    assert actions.shape == (5, 7)
    assert len(np.unique(actions[:3, 0])) == 3
    assert (actions[0] == actions[3]).all()  # the same observation and seed: the same chunk again
