from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ProtocolError, ReportError
from pytest_libero_max.films.recorded import Drawn
from pytest_libero_max.films.replay import Tick, play_again
from pytest_libero_max.lab.rerun_file import Scene, record_pair, scenes
from pytest_libero_max.worlds.robot import CAMERAS
from tests.films.conftest import played, played_once, short
from tests.films.short_run import BUDGET, SIZE, Played, store

__all__ = ["played", "played_once", "short"]  # fixtures


def _ticks(played: Played) -> list[Tick]:
    return list(play_again(played.case, played.world, played.record, played.traces, scenes(SIZE)))


def _scene(tick: Tick, arm: str) -> Scene:
    scene = tick.views[arm]
    assert isinstance(scene, Scene)
    return scene


def test_a_scene_says_where_everything_is(played: Played) -> None:
    for tick in _ticks(played):
        for arm in ("base", "dynamic"):
            scene, trace = _scene(tick, arm), played.traces[arm]
            assert list(scene.images) == list(CAMERAS)
            if tick.step:
                assert np.array_equal(scene.hand, trace.end_effector[tick.step - 1])
                moved = arm == "dynamic" and tick.step == played.record.trigger_step
                box = scene.entities["box_1"][0]
                # By the event, after the step.
                assert np.array_equal(box, trace.entity[tick.step - 1]) != moved


def test_a_camera_sees_an_object_where_its_pose_says(played: Played) -> None:
    """The box is drawn where its place is projected to, through the pose and the angle of the camera."""
    scene = _scene(_ticks(played)[0], "base")
    position, rotation, angle = scene.cameras["agentview"]
    x, y, z = rotation.T @ (scene.entities["box_1"][0] - position)
    focal = 0.5 * SIZE / np.tan(0.5 * angle)
    column, row = round(SIZE / 2 - focal * x / z), round(SIZE / 2 + focal * y / z)
    played.world.reset(played.case.init_state_index)
    with_box = played.world.observe(("agentview",), SIZE)["agentview_image"][::-1].astype(int)
    played.world.park("box_1", (5.0, 5.0, 0.5))
    without = played.world.observe(("agentview",), SIZE)["agentview_image"][::-1].astype(int)
    changed = np.abs(with_box - without).sum(axis=2)
    assert changed[row, column] > 30


def test_without_the_library_the_cure_is_said(
    played: Played, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ReportError, match=r"pip install -e '\.\[rerun\]'"):
        record_pair(tmp_path / "a.rrd", played.case, played.world, played.record, played.traces)


def test_a_recording_is_verified_by_the_library(
    played: Played, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun")
    run = store(played, tmp_path / "run", tmp_path / "tiny.json")
    command = ["lab", "rerun", str(run), "--select=all", f"--size={SIZE}", "--every=3"]
    assert main(command) == 0
    file = run / "rerun" / f"{played.record.item_id}.rrd"
    assert str(file) in capsys.readouterr().out
    assert _asked_of_the_library("verify", file).endswith("1 file verified without error.\n")
    told = _asked_of_the_library("stats", file)
    for arm in ("base", "dynamic"):
        for path in ("action/x", "distance_m", "entities/box_1", "cameras/agentview/image", "words", "hand"):
            assert f"/{arm}/{path}: " in told
    printed = _asked_of_the_library("print", file, "-v")
    pictures, distances = (_rows(printed, f"/base/{name}") for name in ("hand", "distance_m"))
    assert (pictures, distances) == (4, BUDGET), "at steps 0, 3, 6 and 8, and after every step"
    before = file.stat().st_mtime_ns
    assert main(command) == 0
    assert file.stat().st_mtime_ns == before
    with pytest.raises(ReportError, match="exists"):
        record_pair(file, played.case, played.world, played.record, played.traces)


def test_a_replay_that_is_not_what_was_recorded_leaves_no_recording(played: Played, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    traces = played.traces
    actions = traces["base"].actions.copy()
    actions[BUDGET - 1, 0] += 1e-9
    traces["base"] = replace(traces["base"], actions=actions)
    with pytest.raises(ProtocolError):
        record_pair(tmp_path / "a.rrd", played.case, played.world, played.record, traces, Drawn(SIZE))
    assert not [path for path in tmp_path.iterdir() if "rrd" in path.name]


def _rows(printed: str, path: str) -> int:
    """How often something was logged."""
    return sum(map(int, re.findall(rf"with (\d+) rows \(.*\) - {path} - ", printed)))


def _asked_of_the_library(question: str, file: Path, *options: str) -> str:
    command = [sys.executable, "-m", "rerun", "rrd", question, *options, str(file)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return done.stdout + done.stderr
