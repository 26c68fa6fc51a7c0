from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.benchmark.identity import FROZEN_STATES, TRAINING_STATES
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.suites import VARIED
from pytest_libero_max.benchmark.tracks import all_track_names, load_track
from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError
from pytest_libero_max.lab.demos import folder
from pytest_libero_max.lab.demos.episodes import Demonstration, Planned, record
from pytest_libero_max.lab.demos.folder import Settings, collect, load
from pytest_libero_max.lab.demos.lerobot import write_dataset
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.pairing.trace import write_trace
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.transforms.images import rotate_180
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from pytest_libero_max.substrates.registry import open_substrate
from tests.pairing.actors import make_case
from tests.plugin.conftest import tiny_manifest
from tests.report.made_up import PROVENANCE
from tests.short_episodes import shorten_here

ARMS = ("base", "dynamic")

PLANS = [
    Planned(make_case(event), arm)
    for event, arm in (
        ("camera_shift", "base"),
        ("camera_shift", "dynamic"),
        ("target_relocation", "dynamic"),
    )
]


def demo(length: int, event_step: int | None = None, success: bool = True) -> Demonstration:
    generator = np.random.default_rng(length)
    rotations = generator.normal(size=(length, 4))
    observations: dict[str, Any] = {
        "agentview_image": generator.integers(0, 256, (length, 8, 8, 3), dtype=np.uint8),
        "robot0_eye_in_hand_image": generator.integers(0, 256, (length, 8, 8, 3), dtype=np.uint8),
        "robot0_eef_pos": generator.normal(size=(length, 3)),
        "robot0_eef_quat": rotations / np.linalg.norm(rotations, axis=1, keepdims=True),
        "robot0_gripper_qpos": generator.normal(size=(length, 2)),
    }
    return Demonstration(
        success, f"do {length % 2}", event_step, observations, generator.uniform(-1, 1, (length, 7))
    )


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the episodes that are played, without a simulator; the second is not solved."""
    names: list[str] = []

    def record(plan: Planned, world: Any, policy: Any, image_size: int, disturbed: float) -> Demonstration:
        names.append(plan.name)
        return {0: demo(5), 1: demo(9, success=False), 2: demo(6, event_step=2)}[PLANS.index(plan)]

    class Substrate:
        def world(self, case: Any) -> None:
            pass

        def close(self) -> None:
            pass

    monkeypatch.setattr(folder, "record", record)
    monkeypatch.setattr(folder, "open_substrate", lambda name: Substrate())
    return names


def test_episodes_are_kept_and_not_played_again(tmp_path: Path, played: list[str]) -> None:
    first = collect(PLANS[:2], tmp_path, Settings())
    assert [found.path is not None for found in first] == [True, False]
    found = collect(PLANS, tmp_path, Settings())
    assert played == [plan.name for plan in PLANS]
    assert found[2].path is not None
    loaded, about = load(found[2].path)
    assert loaded.actions.tobytes() == demo(6).actions.tobytes()
    assert loaded.observations.keys() == demo(6).observations.keys()
    assert (loaded.event_step, loaded.instruction) == (2, "do 0")
    assert about["event"] == "target_relocation"
    assert not list(tmp_path.rglob("*.partial"))


def test_what_was_executed_is_kept_where_it_is_not_what_the_expert_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, played: list[str]
) -> None:
    (plain,) = collect(PLANS[:1], tmp_path / "plain", Settings())
    executed = demo(5).actions + 0.5
    monkeypatch.setattr(folder, "record", lambda *args: replace(demo(5), executed=executed))
    (pushed,) = collect(PLANS[:1], tmp_path / "pushed", Settings(disturbed=0.25))
    assert plain.path is not None
    assert load(plain.path)[0].executed is None
    assert pushed.path is not None
    loaded, _ = load(pushed.path)
    assert (loaded.actions == demo(5).actions).all()
    assert loaded.executed is not None
    assert (loaded.executed == executed).all()
    with pytest.raises(OptionError, match=r"'disturbed': 0\.25"):
        collect(PLANS[:1], tmp_path / "pushed", Settings())


def test_the_same_episodes_give_the_same_bytes(tmp_path: Path, played: list[str]) -> None:
    pytest.importorskip("pyarrow", reason="the extra 'demos' has it")
    files = []
    for name in ("one", "two"):
        found = collect(PLANS, tmp_path / name, Settings())
        write_dataset([item.path for item in found if item.path is not None], tmp_path / f"{name}-lerobot")
        files.append(
            {
                str(path.relative_to(tmp_path)).replace(name, "", 1): path.read_bytes()
                for path in sorted(tmp_path.rglob("*"))
                if path.is_file() and path.relative_to(tmp_path).parts[0].startswith(name)
            }
        )
    assert files[0] == files[1]
    assert len(files[0]) == 9


def test_other_settings_need_another_folder(tmp_path: Path, played: list[str]) -> None:
    collect(PLANS, tmp_path, Settings())
    with pytest.raises(OptionError, match="'image_size': 128"):
        collect(PLANS, tmp_path, Settings(image_size=64))
    (tmp_path / "demos.json").write_text("{")
    with pytest.raises(OptionError, match=r"demos\.json"):
        collect(PLANS, tmp_path, Settings())


def test_a_dataset_of_lerobot_holds_every_step(tmp_path: Path, played: list[str]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra 'demos' has it")
    found = collect(PLANS, tmp_path / "npz", Settings())
    paths = [item.path for item in found if item.path is not None]
    write_dataset(paths, tmp_path / "lerobot")
    write_dataset(paths, tmp_path / "lerobot")  # a dataset may be replaced
    info = json.loads((tmp_path / "lerobot/meta/info.json").read_text())
    assert (info["codebase_version"], info["total_episodes"], info["total_frames"]) == ("v3.0", 2, 11)
    rows = parquet.read_table(tmp_path / "lerobot/data/chunk-000/file-000.parquet").to_pylist()
    assert {"observation.state", "action", *info["features"]} == rows[0].keys()
    assert [row["episode_index"] for row in rows] == [0] * 5 + [1] * 6
    assert [row["index"] for row in rows] == list(range(11))
    assert [row["event"] for row in rows[5:]] == [False, False, True, True, True, True]
    assert rows[6]["timestamp"] == pytest.approx(0.05)
    assert rows[6]["action"] == pytest.approx(demo(6).actions[1].tolist(), abs=1e-6)
    assert rows[6]["observation.state"][:3] == pytest.approx(
        demo(6).observations["robot0_eef_pos"][1].tolist(), abs=1e-6
    )
    from PIL import Image

    (tmp_path / "image.png").write_bytes(rows[6]["observation.images.image2"]["bytes"])
    shown = np.asarray(Image.open(tmp_path / "image.png"))
    assert (shown == rotate_180(demo(6).observations["robot0_eye_in_hand_image"][1])).all()
    statistics = json.loads((tmp_path / "lerobot/meta/stats.json").read_text())
    actions = np.concatenate([demo(5).actions, demo(6).actions])
    assert statistics["action"]["std"] == pytest.approx(actions.std(axis=0).tolist(), abs=1e-6)
    assert np.shape(statistics["observation.images.image"]["mean"]) == (3, 1, 1)
    episodes = parquet.read_table(tmp_path / "lerobot/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [episode["event_step"] for episode in episodes] == [None, 2]
    assert [episode["event_name"] for episode in episodes] == [None, "target_relocation"]
    assert [(episode["arm"], episode["success"]) for episode in episodes] == [
        ("base", True),
        ("dynamic", True),
    ]
    assert [episode["dataset_to_index"] for episode in episodes] == [5, 11]


def test_a_dataset_replaces_nothing_else(tmp_path: Path, played: list[str]) -> None:
    pytest.importorskip("pyarrow", reason="the extra 'demos' has it")
    found = collect(PLANS[:1], tmp_path / "npz", Settings())
    paths = [item.path for item in found if item.path is not None]
    (tmp_path / "mine").mkdir()
    with pytest.raises(OptionError, match="holds no dataset"):
        write_dataset(paths, tmp_path / "mine")
    with pytest.raises(OptionError, match="no episode"):
        write_dataset([], tmp_path / "other")
    paths[0].write_bytes(paths[0].read_bytes()[:100])
    with pytest.raises(OptionError, match=r"Remove it"):
        write_dataset(paths, tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_the_command_records_on_the_embedded_scenes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["lab", "demos", str(tmp_path), "--suites", "libero_object", "--tasks", "0", "--inits", "10"]
    command += ["--events", "target_relocation", "--image-size", "16", "--jobs", "1"]
    assert main(command) == 0
    assert main(command) == 0
    end = f"Episodes in {tmp_path}: 2. The expert did not complete: 0."
    assert capsys.readouterr().out.splitlines() == [
        *("2 of 2 episodes played", end),
        *("2 of 2 episodes played", end),
    ]
    demo, about = load(tmp_path / "episodes" / "libero_object-t00-i10-base.npz")
    assert "alphabet soup" in demo.instruction
    assert demo.observations["agentview_image"].shape == (len(demo.actions), 16, 16, 3)
    assert (about["event"], about["arm"], about["success"]) == (None, "base", True)
    recovery, about = load(tmp_path / "episodes" / "libero_object-t00-i10-target_relocation-v0.npz")
    assert (about["event"], about["arm"], recovery.success) == ("target_relocation", "dynamic", True)
    step = recovery.event_step
    assert step is not None
    shown = [one.observations["agentview_image"] for one in (demo, recovery)]
    assert shown[0][:step].tobytes() == shown[1][:step].tobytes()
    assert (shown[0][step] != shown[1][step]).any()


@pytest.mark.parametrize(
    ("init", "message"),
    [("9", "--inits 9: frozen cases begin from that state"), ("50", "init=50 is not an initial state")],
)
def test_initial_states_of_frozen_cases_are_not_recorded(
    init: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["lab", "demos", str(tmp_path), "--suites", "libero_object", "--tasks", "0", "--jobs", "1"]
    assert main([*command, "--inits", "10" if init == "9" else "50", init]) == 1
    assert message in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.npz"))


def test_no_frozen_case_begins_from_an_initial_state_for_training() -> None:
    assert not set(FROZEN_STATES) & set(TRAINING_STATES)
    for name in all_track_names():
        states = {case.init_state_index for case in load_track(name) if case.source in ("libero", *VARIED)}
        assert states <= set(FROZEN_STATES), name


class Toy:
    """Moves to where the box begins, and so meets the event."""

    def __init__(self) -> None:
        self.spec = PolicySpec("toy", 10, 5, cameras=(), image_size=64)

    def reset(self, episode: Any) -> None:
        pass

    def predict(self, observation: Any, query: Any) -> Any:
        move = np.clip((np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.05, -1, 1)
        return np.tile([*move, 0, 0, 0, 1], (10, 1))


def test_pairs_of_a_run_are_written_in_the_same_format(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shorten_here(monkeypatch, 12)
    manifest = tmp_path / "cases.json"
    manifest.write_text(json.dumps(tiny_manifest(events=("target_relocation",))))
    cases = load_manifest(manifest).cases
    substrate = open_substrate("tiny")
    pairs = [measure_pair(case, substrate.world(case), Toy()) for case in cases]
    shown = [record(Planned(case, arm), substrate.world(case), Toy(), 16) for case in cases for arm in ARMS]
    substrate.close()
    provenance = {
        **PROVENANCE,
        "substrate": {"name": "tiny"},
        "case_set": {"name": "manifest toy", "path": str(manifest), "digest": "0" * 64},
    }
    store = PairStore(tmp_path / "run", Run.of(cases, provenance))
    for pair in pairs:
        store.append(pair.record)
    store.close()
    write_trace(tmp_path / "run" / "traces", pairs[0])
    command = ["lab", "demos", str(tmp_path / "out"), "--run", str(tmp_path / "run"), "--image-size", "16"]
    command.append(f"--cases={manifest}")
    assert main(command) == 0
    assert "Episodes in" in (said := capsys.readouterr().out)
    assert ": 2. Pairs without traces: 1." in said
    for arm, expected in zip(ARMS, shown[:2], strict=True):
        demo, about = load(tmp_path / "out" / "episodes" / f"{cases[0].item_id}-{arm}.npz")
        assert (about["arm"], about["success"], demo.success) == (arm, False, False)
        assert about["pair"] == cases[0].item_id
        assert demo.event_step == expected.event_step
        assert demo.actions.tobytes() == expected.actions.tobytes()
        assert demo.observations.keys() == expected.observations.keys()
        for key, values in expected.observations.items():
            assert demo.observations[key].tobytes() == values.tobytes(), (arm, key)
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.npz")}
    assert main(command) == 0
    assert times == {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.npz")}


def test_a_share_out_of_range_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["lab", "demos", "here", "--disturb", "2"])
    assert "argument --disturb: '2'" in capsys.readouterr().err
