"""libero-max check, through its command line, on the tiny substrate."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from pytest_libero_max.cli import check, main
from pytest_libero_max.cli.check import _soon
from pytest_libero_max.policies.loading import forget_adapter
from tests.policies.clients import fakes

TEMPLATE = Path(__file__).parents[2] / "fixtures" / "policies" / "vla.py"


@pytest.fixture(autouse=True)
def _adapters_are_forgotten() -> Iterator[None]:
    yield
    forget_adapter()


def test_of_the_template_only_the_stand_in_for_a_model_is_wrong_and_its_pictures_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "seen.png"
    assert main(["check", str(TEMPLATE), "--substrate=tiny", f"--picture={picture}"]) == 1
    out = capsys.readouterr().out
    assert "inputs/any: the answer" in out
    assert "images/rotated, input 'wrist_image': robot0_eye_in_hand, rotated" in out
    assert "my-vla (H=16 Q=8): agentview, robot0_eye_in_hand" in out
    assert "1 wrong, 0 to look" in out
    assert out.count("Model of `libero-max init`") == 1
    sheet = cv2.imread(str(picture))
    assert sheet is not None
    assert sheet.shape == (276, 512, 3)


def test_a_server_that_is_not_there_is_tried_for_seconds_and_said_in_two_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check, "PATIENCE_S", 2)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]  # nobody listens there a moment later
    assert main(["check", f"openpi://127.0.0.1:{port}", "--profile=pi05_libero"]) == 1
    tried, given_up = capsys.readouterr().err.splitlines()
    assert tried.startswith("Trying for 2 s")
    assert f"openpi://127.0.0.1:{port}: " in tried
    assert "given up" in given_up
    assert "--libero-max" not in given_up


def test_each_of_several_servers_is_tried_for_seconds() -> None:
    assert _soon("openpi://a:1,openpi://b:2?timeout=9,openpi://c:3?patience=60") == (
        "openpi://a:1?patience=5,openpi://b:2?timeout=9&patience=5,openpi://c:3?patience=60"
    )


def test_servers_of_a_file_are_tried_as_long_as_that_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    file = tmp_path / "servers.toml"
    file.write_text(
        f'[[servers]]\naddress = "openpi://127.0.0.1:{port}?patience=0.5"\nprofile = "pi05_libero"\n'
    )
    assert main(["check", str(file)]) == 1
    assert capsys.readouterr().err.startswith("Trying as long")


def test_an_address_without_its_scheme_is_completed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "localhost:8123", "--profile=pi05_libero"]) == 1
    assert "a scheme: openpi://localhost:8123" in capsys.readouterr().err


def test_a_served_policy_is_checked_by_what_it_is_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (10, 7))
    actions[:, 6] = -1.0
    with fakes.openpi(lambda request: {"actions": actions + 1e-3 * request["observation/state"][0]}) as port:
        status = main(
            [
                "check",
                f"openpi://127.0.0.1:{port}",
                "--profile=pi05_libero",
                "--substrate=tiny",
                f"--picture={tmp_path / 'seen.png'}",
            ]
        )
    out = capsys.readouterr().out
    assert status == 0
    assert "'image': agentview, rotated" in out
    assert "'wrist': robot0_eye_in_hand, rotated by 180" in out
    assert "input 'state': orientation" in out


def test_a_mistake_is_exit_status_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    adapter = tmp_path / "adapter.py"
    adapter.write_text(
        "import numpy as np\nfrom pytest_libero_max import PolicySpec\n"
        "class policy:\n"
        "    spec = PolicySpec('wrong', 4, 4, cameras=())\n"
        "    def reset(self, episode): pass\n"
        "    def predict(self, observation, query): return 30 * np.ones((4, 7))\n"
    )
    assert main(["check", str(adapter), "--substrate=tiny"]) == 1
    assert "30; expected: movements within [-1, 1]" in capsys.readouterr().out


INVERTED = """
import numpy as np
from pytest_libero_max import PolicySpec


class Inverted:
    spec = PolicySpec("inverted", 4, 4, image_size=32)

    def reset(self, episode):
        pass

    def predict(self, observation, query):
        bits = int(sum(value.sum() for value in observation.values()) * 1e6) + len(query.instruction)
        chunk = np.random.default_rng([abs(bits), query.seed]).uniform(-0.8, 0.8, (4, 7))
        chunk[:, 6] = 1.0
        return chunk


policy = Inverted
"""


def test_strictly_a_probable_mistake_is_exit_status_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    adapter = tmp_path / "adapter.py"
    adapter.write_text(INVERTED)
    arguments = ["check", str(adapter), "--substrate=tiny", f"--picture={tmp_path / 'seen.png'}"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    (marked,) = (line for line in out.splitlines() if line.endswith("[--strict: wrong]"))
    assert marked.startswith("note  gripper/opens: closes")
    assert "Model of `libero-max init`" not in out
    assert "skip  images/colours: orientation" in out
    assert "0 wrong, 1 to look" in out
    assert "--strict counts 1 note" in out
    assert main([*arguments, "--strict"]) == 1
    out = capsys.readouterr().out
    assert "wrong gripper/opens: closes" in out
    assert "1 wrong, 0 to look" in out
