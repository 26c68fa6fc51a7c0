"""The packages of ``.ci/genuine.txt`` as they are installed, with no folder named."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.sampling import stratified
from pytest_libero_max.benchmark.tracks import (
    FOLDER,
    GENUINE,
    PAPER_LITE,
    content_of,
    load_track,
    own_tracks,
    track_path,
)
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.configurations import Configuration, cell_of
from pytest_libero_max.makers.construction.genuine_tracks import SOURCES
from pytest_libero_max.makers.construction.paper_lite import paper_lite
from pytest_libero_max.makers.construction.release import read_unexamined
from pytest_libero_max.substrates.libero.coverage import coverage
from pytest_libero_max.substrates.libero.installation import importable, installed_assets
from pytest_libero_max.substrates.libero.installed_catalogue import InstalledCatalogue
from pytest_libero_max.substrates.libero.lacking import lacking
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.worlds.rendering.renderer import Renderer
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION
from tests.makers.construction.test_official import MANIFEST, OFFICIAL
from tests.scripts.measure_memory import resident_bytes
from tests.substrates.libero import drawn_twice
from tests.substrates.libero.made_up import pro_case

PACKAGE = Path(pytest_libero_max.__file__).parent
SUITE = "libero_object"
CLASSIFICATION = OFFICIAL.parent / "libero_plus" / "task_classification.json"

pytestmark = pytest.mark.skipif(
    installed_assets() is None or not importable("liberoplus"),
    reason="needs the packages of .ci/genuine.txt: LIBERO-PRO's, with its models, and LIBERO-Plus's",
)


def test_libero_pro_and_libero_plus_are_whole_but_for_what_no_package_has() -> None:
    found = {one.source: one for one in coverage(LiberoSubstrate().installations)}
    for source, one in found.items():
        if "Plus" not in source:
            assert (one.playable, one.total) == (40, 40), source
    assert sum(one.total for source, one in found.items() if "Plus" in source) == 10_030
    assert found["LIBERO-Plus Light Conditions"].playable == 0
    layouts = found["LIBERO-Plus Objects Layout"]
    assert (layouts.playable, layouts.total) == (696, 1525)


def test_a_case_of_each_source_plays_on_its_own_data() -> None:
    substrate = LiberoSubstrate()
    worlds = {
        "LIBERO": substrate.task_world(SUITE, 0, 195),
        "object": substrate.world(pro_case("object", SUITE, 0)),
        "task": substrate.world(pro_case("task", SUITE, 0)),
        "Camera Viewpoints": substrate.plus_world(SUITE, 646, 195),
    }
    digests = set()
    for world in worlds.values():
        world.reset(0)
        world.step(NOOP_ACTION)
        assert not world.succeeded()
        digests.add(world.digest())
    assert len(digests) == len(worlds)
    assert "alphabet_soup_1" in worlds["LIBERO"].entities
    assert worlds["task"].language == "Pick the cream cheese and place it in the basket"
    assert worlds["Camera Viewpoints"].language.endswith("view 0 0 100 2 4 initstate 0")
    substrate.close()


def test_two_seeds_of_a_task_share_an_upload_and_leave_out_nothing_visible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    substrate = LiberoSubstrate()
    worlds = [substrate.task_world("libero_10", 2, seed) for seed in (0, 1)]
    images = [world.observe(size=128) for world in worlds]
    uploaded, other = (world._renderer._uploaded for world in worlds if world._renderer is not None)
    assert uploaded is not None
    assert uploaded is other
    world = worlds[0]
    assert world._view is not None
    plain = Renderer(world.model, world._view, reflections=True)
    with monkeypatch.context() as patch:
        patch.setattr(type(uploaded), "holds", lambda *_: False)
        for name in CAMERAS:
            assert np.array_equal(images[0][f"{name}_image"], plain.render(name, 128)), name
    assert plain._uploaded is not uploaded
    assert uploaded.holds(world.model)
    world.model.tex_data[-1] ^= 1
    assert not uploaded.holds(world.model)
    plain.close()
    substrate.close()


@pytest.mark.parametrize(
    ("suite", "task", "events"),
    [
        ("libero_10", 2, ("camera_shift", "target_relocation")),
        ("libero_spatial", 0, ("obstacle_insertion",)),
        ("libero_object", 1, ("distractor_burst", "visual_theme_switch")),
    ],
)
def test_images_before_and_after_an_event_leave_out_nothing_visible(
    suite: str, task: int, events: tuple[str, ...]
) -> None:
    substrate = LiberoSubstrate()
    drawn = list(drawn_twice.measure(substrate, suite, task, 96, events))
    substrate.close()
    assert {image.event for image in drawn} == {*events, drawn_twice.ALTERED}
    assert [image for image in drawn if image.unequal] == []


def test_a_built_scene_leaves_no_copy_of_its_textures_and_meshes_in_mujoco() -> None:
    substrate = LiberoSubstrate()
    substrate.task_world("libero_object", 2, 0)
    before = resident_bytes()
    mujoco.MjModel.from_xml_string("<mujoco/>")  # in the place of the last document
    assert before - resident_bytes() < 50e6
    substrate.close()


@pytest.mark.skipif(not MANIFEST.is_file(), reason="the released manifests are not here")
def test_every_released_case_is_made_again_from_the_packages_and_may_play() -> None:
    installations, released = LiberoSubstrate().installations, load_manifest(MANIFEST)
    for case, made in _made_again(released, InstalledCatalogue(installations), ["pro"]):
        theirs = {**case.record, "substrate_variant": dict(case.record["substrate_variant"])}
        del theirs["substrate_variant"]["source_revision"]  # of the data set; a package has a version
        assert made.record == theirs
    assert lacking(installations, released) == {}


@pytest.mark.skipif(not CLASSIFICATION.is_file(), reason="LIBERO-Plus's classification is not here")
def test_the_frozen_genuine_cases_are_made_again_from_the_packages() -> None:
    catalogue = InstalledCatalogue(LiberoSubstrate().installations, CLASSIFICATION)
    tracks = (load_track(f"{GENUINE}/{name}") for name in own_tracks(FOLDER / GENUINE))
    frozen = [case for track in tracks for case in stratified(track.cases, 320)]
    for case, made in _made_again(frozen, catalogue, SOURCES):
        assert made.record == case.record


def test_the_frozen_genuine_cases_play_but_for_those_that_were_not_examined() -> None:
    installations, unexamined = LiberoSubstrate().installations, read_unexamined(FOLDER / GENUINE)
    for name in own_tracks(FOLDER / GENUINE):
        cases = load_track(f"{GENUINE}/{name}").cases
        lacks = lacking(installations, cases)
        without_wand = {case_id for case_id, reason in lacks.items() if "Wand" in reason}
        assert lacks.keys() - without_wand == {case.case_id for case in cases} & unexamined.keys()


@pytest.mark.parametrize(
    ("works", "counts"), [(True, "598 of lite and 5,924 of max"), (False, "583 and 5,774")]
)
def test_the_documentation_counts_the_cases_that_play_with_and_without_imagemagick(
    works: bool, counts: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_libero_max.substrates.libero.lacking.usable", lambda module: works)
    tracks = [load_track(f"{GENUINE}/{name}").cases for name in ("lite", "max")]
    play = [len(cases) - len(lacking(LiberoSubstrate().installations, cases)) for cases in tracks]
    assert play == [int(number.replace(",", "")) for number in re.findall(r"\d,?\d+", counts)]
    page = (PACKAGE.parent / "docs" / "explanation" / "scenes.md").read_text()
    assert counts in " ".join(page.replace("`", "").split())


@pytest.mark.skipif(not CLASSIFICATION.is_file(), reason="LIBERO-Plus's classification is not here")
def test_the_authors_lite_is_made_again_byte_for_byte_from_its_ids() -> None:
    catalogue = InstalledCatalogue(LiberoSubstrate().installations, CLASSIFICATION)
    path = track_path(f"{GENUINE}/{PAPER_LITE}")
    case_ids = sorted(case.case_id for case in load_track(f"{GENUINE}/{PAPER_LITE}"))
    assert paper_lite(case_ids, catalogue).to_json().encode() == content_of(path)
    with pytest.raises(ManifestError, match="camera_shift-d2-p195'"):
        paper_lite([*case_ids, "libero_10-t0009-camera_shift-d2-p195"], catalogue)


@pytest.mark.parametrize(("works", "count"), [(True, 617), (False, 602)])
def test_the_documentation_counts_the_cases_of_the_authors_lite_that_play(
    works: bool, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pytest_libero_max.substrates.libero.lacking.usable", lambda module: works)
    cases = load_track(f"{GENUINE}/{PAPER_LITE}").cases
    assert len(cases) - len(lacking(LiberoSubstrate().installations, cases)) == count
    page = (FOLDER.parent / "reports" / "genuine" / "beside-the-paper.md").read_text()
    assert "617 of the 800 play" in page
    assert "without it 602" in page


def _made_again(
    cases: Iterable[Case], catalogue: InstalledCatalogue, sources: Iterable[str]
) -> Iterator[tuple[Case, Case]]:
    """Each case, and the one that is made from what is installed."""
    tasks = {
        (one.source, one.category, one.suite, one.index): one
        for source in sources
        for one in catalogue.variations(source)
    }
    for case in cases:
        task = tasks[case.source, case.source_category, case.suite, case.task_index]
        yield case, Configuration(task, case.init_state_index, catalogue).case(cell_of(case))
