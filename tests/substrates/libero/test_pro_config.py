from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.pro_config import (
    SECTIONS,
    check_category,
    interests,
    published_config,
    read_config,
    tinted,
)
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from pytest_libero_max.tasks.sources import PRO_CATEGORIES
from tests.substrates.libero.data import needs_package

HEAD = "(define (problem LIBERO_Tabletop_Manipulation) (:domain robosuite) (:language Do it)"
POSE = "(:initial_pose (:enabled true) (:mode delta_xy_yaw) (:target Plate_1) (:delta_xy 0.17 -0.06) {})"
REST = "(:min_delta_norm 0.18) (:yaw 0.5)"
OFF = "(:camera (:enabled false) (:mode none) (:name agentview) (:pos 0.0 0.0 0.0))"


def bddl(folder: Path, *sections: str) -> Path:
    path = folder / "task.bddl"
    path.write_text(f"{HEAD} (:perturbation_config (:case any) {' '.join(sections)}))")
    return path


def test_another_category_is_refused() -> None:
    assert tuple(SECTIONS) == PRO_CATEGORIES
    with pytest.raises(SubstrateError, match=r"no category 'view_oclusion'.*'view_occlusion'"):
        check_category("view_oclusion")


@needs_package
def test_sections_that_are_switched_on_are_read(tmp_path: Path) -> None:
    config = read_config(bddl(tmp_path, OFF, POSE.format(REST)), "initial_pose_position_angle")
    assert set(config) == {"initial_pose"}
    section = config["initial_pose"]
    assert section["target"] == ("plate_1",)
    assert section["delta_xy"] == (0.17, -0.06)
    assert section["yaw"] == (0.5,)


@needs_package
def test_lists_in_brackets_lose_their_brackets(tmp_path: Path) -> None:
    placement = (
        "(:object_placement (:enabled true) (:mode front_occlusion) (:reference a_1) "
        "(:front_direction 1.0 0.0) (:targets b_1 c_1) (:offsets_xy ((0.080 0.000))) (:target_quat 1 0 0 0) "
        "(:z_offset 0) (:min_reference_distance 0.02))"
    )
    section = read_config(bddl(tmp_path, placement), "view_occlusion")["object_placement"]
    assert section["offsets_xy"] == (0.08, 0.0)
    assert section["targets"] == ("b_1", "c_1")


@needs_package
@pytest.mark.parametrize(
    ("sections", "category", "wrong"),
    [
        ((), "initial_pose_position_angle", "initial_pose is missing or switched off"),
        ((OFF,), "camera_view_angle", "camera is missing or switched off"),
        ((POSE.format(""),), "initial_pose_position_angle", "initial_pose lacks min_delta_norm, yaw"),
        (
            ("(:camera (:enabled true) (:mode orbit) (:name agentview) (:pos 0 0 0) (:quat 1 0 0 0))",),
            "camera_view_angle",
            "camera is not of the mode 'agentview_angle'",
        ),
    ],
)
def test_a_file_that_lacks_what_it_is_for_is_refused(
    tmp_path: Path, sections: tuple[str, ...], category: str, wrong: str
) -> None:
    with pytest.raises(SubstrateError, match=rf"{wrong}\..*LIBERO-Pro"):
        read_config(bddl(tmp_path, *sections), category)


@needs_package
def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "task.bddl"
    path.write_text(f"{HEAD} (")
    with pytest.raises(SubstrateError, match=r"Cannot read .*task\.bddl"):
        read_config(path, "semantic")


@needs_package
@pytest.mark.parametrize(
    ("suite", "index", "targets"),
    [
        ("libero_spatial", 0, ("plate_1",)),
        ("libero_object", 0, ("basket_1",)),
        ("libero_goal", 0, ("wooden_cabinet_1",)),
        ("libero_goal", 5, ("plate_1",)),
        ("libero_10", 2, ("flat_stove_1",)),
        ("libero_10", 4, ("plate_1", "plate_2")),
        ("libero_10", 6, ("plate_1",)),
    ],
)
def test_the_goals_destinations_are_tinted(
    substrate: LiberoSubstrate, suite: str, index: int, targets: tuple[str, ...]
) -> None:
    assert tinted(substrate.task_world(suite, index, 195)) == targets


@needs_package
@pytest.mark.parametrize(
    ("suite", "index", "expected"),
    [
        ("libero_spatial", 3, ["akita_black_bowl_1", "plate_1"]),
        ("libero_goal", 0, ["wooden_cabinet_1"]),
        ("libero_goal", 5, ["plate_1"]),
        ("libero_10", 6, ["plate_1", "chocolate_pudding_1", "porcelain_mug_1"]),
    ],
)
def test_what_a_task_is_about_comes_in_its_own_order(
    substrate: LiberoSubstrate, suite: str, index: int, expected: list[str]
) -> None:
    """LIBERO-PRO's target is the first of them, even where that is what something is put on."""
    world = substrate.task_world(suite, index, 195)
    assert interests(world) == expected
    pose = published_config("initial_pose_position_angle", suite, index, world)["initial_pose"]
    assert pose["target"] == (expected[0],)
