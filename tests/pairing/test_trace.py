from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.trace import read_trace, traces_of, write_trace
from pytest_libero_max.substrates.tiny.world import TinyWorld

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


def test_a_trace_is_read_as_it_was_written(tmp_path: Path) -> None:
    settings = PairSettings(films=True)
    pair = measure_pair(make_case(), TinyWorld(), Approaching(wait=2, horizon=5, interval=4), settings)
    written, read = traces_of(pair), read_trace(write_trace(tmp_path, pair), pair.record)
    assert list(read) == ["base", "dynamic"]
    for name, trace in read.items():
        for part, values in vars(trace).items():
            expected = getattr(written[name], part)
            assert (values.dtype, values.tobytes()) == (expected.dtype, expected.tobytes())


def test_a_trace_of_another_run_or_none_at_all_is_refused(tmp_path: Path) -> None:
    pair = measure_pair(make_case(), TinyWorld(), Approaching(wait=2, horizon=5, interval=4))
    path = write_trace(tmp_path, pair)
    arms = {name: replace(arm, steps=arm.steps and arm.steps + 1) for name, arm in pair.record.arms.items()}
    shapes = rf"base_actions has shape \({BUDGET}, 7\), but the record.*\({BUDGET + 1}, 7\)"
    with pytest.raises(ReportError, match=shapes):
        read_trace(path, replace(pair.record, arms=arms))
    arms = {**pair.record.arms, "third": pair.record.arms["base"]}
    with pytest.raises(ReportError, match="third_actions is missing"):
        read_trace(path, replace(pair.record, arms=arms))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(ReportError, match="Cannot read"):
        read_trace(path, pair.record)


@pytest.mark.parametrize(
    ("part", "values"),
    [
        ("actions", np.full((BUDGET, 7), "1")),
        ("actions", np.full((BUDGET, 7), np.nan)),
        ("query_steps", np.zeros(13)),
        ("query_steps", np.zeros((13, 1), np.int64)),
        ("entity", np.full((BUDGET, 3), np.inf)),
        ("answers", np.zeros((13, 5, 7), np.complex128)),
        ("joints", np.zeros(BUDGET)),
    ],
)
def test_a_trace_of_what_no_film_can_show_is_refused(
    tmp_path: Path, part: str, values: NDArray[np.generic]
) -> None:
    settings = PairSettings(films=True)
    pair = measure_pair(make_case(), TinyWorld(), Approaching(wait=2, horizon=5, interval=4), settings)
    path = write_trace(tmp_path, pair)
    with np.load(path) as arrays:
        damaged = {**arrays, f"base_{part}": values}
    np.savez_compressed(path, allow_pickle=False, **damaged)
    with pytest.raises(ReportError, match=r"base_\w+ has"):
        read_trace(path, pair.record)
