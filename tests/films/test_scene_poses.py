from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.cli import main
from pytest_libero_max.cli.poses import _writer
from pytest_libero_max.errors import ReportError
from pytest_libero_max.films.recorded import pose_pair
from pytest_libero_max.films.replay import play_again
from pytest_libero_max.films.scene_poses import Posed, look_at_poses
from pytest_libero_max.report.page.scenes import scenes_of
from pytest_libero_max.runs.recorded_poses import (
    POSITION_M,
    TURN,
    RecordedPoses,
    packed,
    read_poses,
    unpacked,
    write_poses,
)

from .short_run import BUDGET, Played, play, store


@pytest.fixture
def poses(played: Played, tmp_path: Path) -> RecordedPoses:
    return _written(played, tmp_path / "poses.npz")


def _written(played: Played, path: Path) -> RecordedPoses:
    pose_pair(path, played.case, played.world, played.record, played.traces)
    return read_poses(path)


def _arm(poses: RecordedPoses, name: str) -> tuple[Any, NDArray[np.int16]]:
    """An arm of the header, and its own poses."""
    begin, bodies = 0, len(poses.header["moving"])
    for arm in poses.header["arms"]:
        steps = arm["steps"] - arm["from"] + 1
        size = 2 * 7 * bodies * steps
        if arm["name"] == name:
            return arm, unpacked(poses.moves[begin : begin + size], steps, bodies)
        begin += size
    raise AssertionError(name)


def _body(poses: RecordedPoses, name: str) -> int:
    (number,) = [number for number, (known, _) in enumerate(poses.header["bodies"]) if known == name]
    return number


def test_poses_are_those_of_the_world_after_every_step(played: Played, poses: RecordedPoses) -> None:
    moving = poses.header["moving"]
    seen = {
        tick.step: tick.views
        for tick in play_again(played.case, played.world, played.record, played.traces, look_at_poses())
    }
    for name in ("base", "dynamic"):
        arm, values = _arm(poses, name)
        assert arm["steps"] == BUDGET
        for step in range(arm["from"], BUDGET + 1):
            view, own = seen[step][name], values[step - arm["from"]]
            assert isinstance(view, Posed)
            assert np.abs(own[:, :3] * POSITION_M - view.bodies[moving, :3]).max() <= POSITION_M
            turns, wanted = own[:, 3:] * TURN, view.bodies[moving, 3:]
            signs = np.sign((turns * wanted).sum(axis=1, keepdims=True))
            assert np.abs(signs * turns - wanted).max() <= TURN
            if step:
                hand = played.traces[name].end_effector[step - 1]
                assert np.abs(np.array(arm["hand"]).reshape(-1, 3)[step] / 1e3 - hand).max() <= 5.1e-4


def test_what_an_event_moves_leaves_its_place_behind_and_arms_part_there(
    played: Played, poses: RecordedPoses
) -> None:
    event = played.record.trigger_step
    (base, before), (dynamic, after) = _arm(poses, "base"), _arm(poses, "dynamic")
    assert (base["from"], dynamic["from"]) == (0, event)
    assert (base["events"], dynamic["events"], base["left"]) == ([], [event], [])
    ((step, body, left),) = dynamic["left"]
    assert (step, body) == (event, _body(poses, "box_1"))
    row = poses.header["moving"].index(body)
    assert np.allclose(left[:3], before[event][row, :3] * POSITION_M, atol=POSITION_M)
    assert np.linalg.norm(after[0][row, :3] * POSITION_M - left[:3]) > 0.03


def test_states_that_films_are_drawn_from_give_the_poses_that_playing_again_gives(
    tmp_path: Path, played: Played
) -> None:
    kept = play(tmp_path, films=True)
    assert kept.traces["base"].joints is not None
    shown, simulated = _written(kept, tmp_path / "kept.npz"), _written(played, tmp_path / "played.npz")
    kept.world.close()
    assert shown.header["moving"] == simulated.header["moving"]
    for name in ("base", "dynamic"):
        (arm, one), (_, other) = _arm(shown, name), _arm(simulated, name)
        assert np.abs(one.astype(int) - other).max() <= 1, arm


@pytest.mark.parametrize(
    ("event", "changed"),
    [("illumination_switch", "lights"), ("camera_shift", "cameras"), ("visual_theme_switch", "looks")],
)
def test_what_an_event_does_to_light_camera_and_colours_is_followed(
    tmp_path: Path, event: str, changed: str
) -> None:
    played = play(tmp_path, event=event)
    poses = _written(played, tmp_path / "poses.npz")
    played.world.close()
    base, dynamic = poses.header["arms"]
    for part in ("lights", "cameras", "looks"):
        assert [step for step, _ in base[part]] == [0]
        steps = [0, *dynamic["events"]] if part == changed else [0]
        assert [step for step, _ in dynamic[part]] == steps


def test_a_thing_that_appears_is_hidden_before(tmp_path: Path) -> None:
    played = play(tmp_path, event="obstacle_insertion")
    poses = _written(played, tmp_path / "poses.npz")
    played.world.close()
    (_, first), (step, later) = poses.header["arms"][1]["looks"]
    assert step == played.record.trigger_step
    assert (first.count(-1), later.count(-1)) == (1, 0)


def test_the_same_pair_gives_the_same_file(played: Played, tmp_path: Path) -> None:
    for name in ("one.npz", "other.npz"):
        _written(played, tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()


def test_packed_poses_come_back() -> None:
    values = np.random.default_rng(0).integers(-32767, 32767, (9, 3, 7)).astype(np.int16)
    assert np.array_equal(unpacked(packed(values), 9, 3), values)


def test_the_command_writes_poses_and_the_page_takes_them_in(
    played: Played, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, item = store(played, tmp_path / "run", tmp_path / "tiny.json"), played.record.item_id
    cases = f"--cases={tmp_path / 'tiny.json'}"
    assert main(["report", str(run)]) == 0
    before = (run / "report.html").read_text()
    assert "class SceneView" not in before
    assert main(["poses", str(run), item, cases]) == 0
    assert f"1/1 {run / 'poses' / item}.npz (" in capsys.readouterr().out
    assert main(["report", str(run)]) == 0
    page = (run / "report.html").read_text()
    assert "class SceneView" in page
    assert "data-name='pair-0'" in page
    assert main(["poses", str(run), item, cases]) == 0
    assert "is there already" in capsys.readouterr().out
    (run / "poses" / f"{item}.npz").write_bytes(b"damaged")
    assert main(["report", str(run)]) == 0
    assert (run / "report.html").read_text() == before


def test_scenes_of_others_are_refused_and_another_way_is_named() -> None:
    with pytest.raises(ReportError, match="substrate 'libero', whose models are not this package's own"):
        _writer({"substrate": {"name": "libero"}})


@pytest.mark.parametrize(
    "header", [b"[]", b'{"scale": NaN}', b'{"scale": 1e999}', b'{"a": 18446744073709551616}', b"[" * 5000]
)
def test_poses_whose_header_no_page_can_hold_are_left_out(tmp_path: Path, header: bytes) -> None:
    path = tmp_path / "poses" / "a.npz"
    path.parent.mkdir()
    arrays = {"header": np.frombuffer(header, np.uint8), "moves": np.zeros(4, np.uint8)}
    np.savez_compressed(path, allow_pickle=False, **arrays)
    with pytest.raises(ReportError, match="Cannot read the poses"):
        read_poses(path)
    assert scenes_of(tmp_path, ["a"]).named == {}


def test_a_page_holds_what_it_may_and_no_shape_twice(poses: RecordedPoses, tmp_path: Path) -> None:
    assert scenes_of(tmp_path, ["a"]).named == {}
    part = np.random.default_rng(1).bytes(5_000)
    shared = RecordedPoses(poses.header, {"shared": part}, poses.moves)
    for name in "abc":
        write_poses(tmp_path / "poses" / f"{name}.npz", shared)
    scenes = scenes_of(tmp_path, ["c", "a", "b", "missing"])
    assert scenes.named == {"c": "pair-0", "a": "pair-1", "b": "pair-2"}
    assert list(scenes.contents) == ["shared", "pair-0", "pair-1", "pair-2"]
    sizes = [len(content) for content in scenes.contents.values()]
    assert scenes_of(tmp_path, ["c", "a", "b"], sum(sizes)).named == scenes.named
    assert list(scenes_of(tmp_path, ["c", "a", "b"], sum(sizes) - 1).named) == ["c", "a"]
