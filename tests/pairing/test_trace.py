from __future__ import annotations

from pathlib import Path

import numpy as np

from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.pairing.trace import write_trace
from pytest_libero_max.worlds.tiny.world import TinyWorld

from .actors import BUDGET, Approaching, make_case


def test_the_trigger_can_be_recomputed_from_a_trace(tmp_path: Path) -> None:
    case = make_case("target_relocation")
    pair = measure_pair(case, TinyWorld(), Approaching(wait=2, horizon=5, interval=4))
    path = write_trace(tmp_path / "traces", pair)
    assert path.name == "libero-spatial-t00-i03-target_relocation-v0.npz"
    with np.load(path, allow_pickle=False) as trace:
        distance = np.linalg.norm(trace["base_end_effector"] - trace["base_entity"], axis=1)
        step = int(trace["trigger_step"])
        assert step == pair.record.trigger_step == 1 + np.argmax(distance <= 0.18)
        assert (trace["base_actions"][:step] == trace["dynamic_actions"][:step]).all()
        for arm in ("base", "dynamic"):
            assert trace[f"{arm}_query_steps"].tolist() == list(range(0, BUDGET, 4))
            assert trace[f"{arm}_actions"].shape == (BUDGET, 7)


def test_a_pair_without_an_event_has_one_arm(tmp_path: Path) -> None:
    pair = measure_pair(make_case(), TinyWorld(), Approaching(wait=BUDGET))
    with np.load(write_trace(tmp_path, pair)) as trace:
        assert trace["trigger_step"] == -1
        assert not [name for name in trace.files if name.startswith("dynamic")]
