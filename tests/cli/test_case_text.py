from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from pytest_libero_max.benchmark.certificates import ENDINGS, Certificate
from pytest_libero_max.benchmark.manifests import Manifest, find_case, load_manifest, parse_manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.cli import main
from pytest_libero_max.cli.case_text import case_lines, event_pictures, write_event_pictures
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.films.short_run import leave_out_shadows
from tests.plugin.conftest import tiny_manifest


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[TinyWorld]:
    leave_out_shadows(monkeypatch)
    world = TinyWorld()
    yield world
    world.close()


@pytest.fixture
def manifest(tmp_path: Path) -> Manifest:
    path = tmp_path / "tiny.json"
    path.write_text(json.dumps(tiny_manifest(events=("target_relocation",))))
    return load_manifest(path)


def test_a_case_is_told_in_words() -> None:
    case = next(case for case in load_track("original") if case.event.name == "target_relocation")
    text = "\n".join(case_lines(case, {case.case_id: Certificate("solved", 11, 61)}))
    for words in (
        "Instruction: pick up ",
        "(the task's own)",
        "Scene: unmodified",
        "Event: The target is moved along its support",
        "Family geometry, severity ",
        f"Episode: at most {case.budget} steps",
        "Certificate: the expert completes Dynamic (event after 11 steps, 61 steps in all)",
        f"Play it alone with -k {case.item_id}",
    ):
        assert words in text
    told = {
        next(
            line
            for line in case_lines(case, {case.case_id: Certificate(ending, 11, 220)})
            if line.startswith("Certificate: the expert ")
        )
        for ending in ENDINGS
    }
    assert len(told) == len(ENDINGS)
    other = replace(case, instruction="fetch it")
    text = "\n".join(case_lines(other, {}))
    assert "Instruction: fetch it" in text
    assert "Certificate: none, since" in text


def test_a_variation_says_how_its_scene_differs() -> None:
    case = next(case for case in load_track("recovery_development") if case.source == "pro")
    lines = case_lines(case, {})
    scene = next(line for line in lines if line.startswith("Scene: "))
    assert scene.startswith(f"Scene: pro/{case.source_category}/{case.suite}/")
    assert "(the variation's own)" in "\n".join(lines)


def test_a_case_is_found_by_either_name(manifest: Manifest) -> None:
    case = manifest.cases[0]
    assert find_case(manifest, case.case_id) is find_case(manifest, case.item_id) is case
    with pytest.raises(OptionError, match="Did you mean"):
        find_case(manifest, case.item_id[:-1])


def test_pictures_show_the_event_in_every_camera(
    world: TinyWorld, manifest: Manifest, tmp_path: Path
) -> None:
    case = manifest.cases[0]
    paths = write_event_pictures(tmp_path / "pictures", world, case, 48)
    assert [path.name for path in paths] == [
        f"{case.item_id}--{camera}-{when}.png"
        for camera in ("agentview", "robot0_eye_in_hand")
        for when in ("before", "after")
    ]
    pictures = [np.asarray(Picture.open(path)) for path in paths]
    assert {picture.shape for picture in pictures} == {(48, 48, 3)}
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[2] != pictures[3]).any()
    assert (pictures[1] == world.observe(size=48)["agentview_image"][::-1]).all()
    with pytest.raises(OptionError, match=r"before\.png exists"):
        write_event_pictures(tmp_path / "pictures", world, case, 48)


def test_a_change_of_one_camera_leaves_the_other_picture_alone(world: TinyWorld) -> None:
    case = parse_manifest(tiny_manifest(events=("camera_shift",))).cases[0]
    world.reset(0)
    pictures = event_pictures(world, case, 48)
    different = {camera for camera, (before, after) in pictures.items() if (before != after).any()}
    assert different == {"agentview"}


def test_what_no_way_reaches_is_refused(world: TinyWorld, manifest: Manifest, tmp_path: Path) -> None:
    case = manifest.cases[0]
    far = replace(case, event=replace(case.event, trigger=Proximity("box_1", 1e-12).to_dict()))
    with pytest.raises(OptionError, match="come within 1e-12 m of box_1"):
        write_event_pictures(tmp_path / "pictures", world, far, 48)
    assert not (tmp_path / "pictures").exists()


def test_the_command_shows_a_case_and_writes_its_pictures(
    world: TinyWorld, manifest: Manifest, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = manifest.cases[0].case_id
    where = ["--pictures", str(tmp_path / "pictures"), "--size", "32", "--substrate", "tiny"]
    assert main(["list", "cases", str(tmp_path / "tiny.json"), case, *where]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{case}: target_relocation")
    assert shown.count("Written: ") == len(list((tmp_path / "pictures").iterdir())) == 4
    assert main(["list", "cases", "smoke", *where]) == 1
    assert "give CASE as" in capsys.readouterr().err
