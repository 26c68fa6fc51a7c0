"""Pairs during a training by LeRobot's own trainer, in an environment that has LeRobot."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from pytest_libero_max import read_pairs
from tests.plugin.conftest import tiny_manifest
from tests.policies.peers.conftest import PYTHON, require

HERE = Path(__file__).parent


def test_lerobots_trainer_evaluates_by_pairs_and_learns_the_same(tmp_path: Path) -> None:
    require("lerobot.scripts.lerobot_train, accelerate, datasets")
    (tmp_path / "tiny.json").write_text(json.dumps(tiny_manifest()))
    done = subprocess.run(
        [PYTHON, str(HERE / "lerobot_training.py"), str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "PYTHONPATH": str(HERE.parents[2]), "HF_HUB_OFFLINE": "1"},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["same"]
    assert told["parameters"] > 10
    assert [step for step, _, _ in told["history"]] == [2, 4]
    assert [numbers["pairs/played"] for _, _, numbers in told["history"]] == [2, 2]
    records = [read_pairs(tmp_path / "runs" / f"step-{step:08d}").records for step in (2, 4)]
    assert [each[0].policy["revision"] for each in records] == ["step-2", "step-4"]
    assert records[0][0].policy["name"] == "lerobot-act"
    first, later = (each[0].base_digest for each in records)
    assert first != later  # other weights act otherwise
