"""Datasets of demonstrations, read by LeRobot itself."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.lab.demos.episodes import Planned
from pytest_libero_max.lab.demos.folder import save
from pytest_libero_max.lab.demos.lerobot import write_dataset
from pytest_libero_max.policies.transforms.images import rotate_180
from tests.lab.demos.test_folder import demo as demonstration
from tests.pairing.actors import make_case
from tests.policies.peers.conftest import PYTHON, require


def test_a_dataset_of_demonstrations_is_one_of_lerobots(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="the extra 'demos' has it")
    require("lerobot.datasets.lerobot_dataset")
    plans = [Planned(make_case("camera_shift"), arm) for arm in ("base", "dynamic")]
    demos = [demonstration(5), demonstration(6, event_step=2)]
    paths = [tmp_path / f"{plan.name}.npz" for plan in plans]
    for path, plan, demo in zip(paths, plans, demos, strict=True):
        save(path, plan, demo)
    write_dataset(paths, tmp_path / "lerobot")
    command = [
        PYTHON,
        str(Path(__file__).with_name("lerobot_dataset.py")),
        str(tmp_path / "lerobot"),
        "0",
        "6",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["counts"] == [2, 11, 20]
    assert {"action", "observation.state", "observation.images.image"} <= set(found["statistics"])
    for item, demo, step in zip(found["items"], demos, (0, 1), strict=True):
        assert item["task"] == demo.instruction
        assert np.allclose(item["action"], demo.actions[step], atol=1e-6)
        assert np.allclose(
            item["observation.state"][:3], demo.observations["robot0_eef_pos"][step], atol=1e-6
        )
        for key, name in (("image", "agentview"), ("image2", "robot0_eye_in_hand")):
            image = rotate_180(demo.observations[f"{name}_image"][step])
            assert (np.array(item[f"observation.images.{key}"]) == image).all()
