"""The adapter for LeRobot, beside LeRobot's own evaluation, in an environment that has LeRobot."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import numpy as np

from tests.policies.peers.conftest import HERE, PYTHON, require

ROOT = HERE.parents[2]


def test_the_adapter_returns_what_lerobots_evaluation_executes(tmp_path: Path) -> None:
    require("lerobot")
    adapter = ROOT / "fixtures" / "policies" / "lerobot_policy.py"
    done = subprocess.run(
        [PYTHON, str(HERE / "lerobot_own.py"), str(adapter), str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.splitlines()[-1])
    adapter_actions, executed = np.array(found["adapter"]), np.array(found["lerobot"])
    assert adapter_actions.shape == (8, 7)
    assert executed.shape == (4, 7)
    assert np.allclose(adapter_actions[:4], executed, atol=1e-6)
    assert np.ptp(adapter_actions) > 0.01
