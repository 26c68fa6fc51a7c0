from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.cases import load_manifest
from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.contract import NOOP_ACTION
from pytest_libero_max.worlds.libero.pro import CATEGORIES, ProVariation, tinted_entities
from pytest_libero_max.worlds.libero.substrate import LiberoSubstrate
from tests.worlds.libero.data import needs_package
from tests.worlds.libero.reference import Reference, assert_same
from tests.worlds.states import differing, every_array, random_actions

OFFICIAL = Path(__file__).parents[4] / "shared" / "official" / "libero_max_pro_model_comparison_800.json"


def test_categories_that_need_more_are_refused() -> None:
    with pytest.raises(SubstrateError, match=r"'view_occlusion' needs task files.*plays semantic"):
        ProVariation("view_occlusion")


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
    assert tinted_entities(substrate.task_world(suite, index, 195)) == targets


@needs_package
def test_the_camera_stands_where_the_published_runtime_puts_it(substrate: LiberoSubstrate) -> None:
    """The picture, and when it is taken: the runtime looks once more after it has moved the camera."""
    world = substrate.task_world("libero_object", 2, 195).varied(ProVariation("camera_view_angle"))
    (found,) = substrate.installations
    from pytest_libero_max.worlds.libero.tasks import task_of

    reference = Reference(found, task_of(found, "libero_object", 2), 195, images=True)
    world.reset(3)
    reference.start(world.initial_state(3))
    camera = reference.model.camera("agentview").id
    reference.model.cam_pos[camera] = (0.48, 0.24, 1.62)
    reference.model.cam_quat[camera] = (0.6099232, 0.3594558, 0.3594558, 0.6099232)
    reference.refresh()
    assert_same(world, reference, "start")
    for number, action in enumerate(random_actions(2, 3)):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")


@needs_package
def test_a_variation_touches_what_it_names_and_goes_with_it(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_spatial", 1, 195)
    world.reset(0)
    before = every_array(world.model)
    touched = {
        "semantic": [],
        "object_shape": [],
        "camera_view_angle": ["cam_pos", "cam_quat"],
        "object_texture": ["geom_rgba", "mat_rgba"],
    }
    assert set(touched) == set(CATEGORIES)
    for category, fields in touched.items():
        world.varied(ProVariation(category)).reset(0)
        assert differing(before, every_array(world.model)) == fields, category
    plate = world._geoms("plate_1")
    shown = [geom for geom in plate if world.model.geom_group[geom] == 1]
    world.varied(ProVariation("object_texture")).reset(0)
    assert np.allclose(world.model.geom_rgba[shown], (0.72, 0.63, 0.50, 1.0))
    world.varied(None).reset(0)
    assert differing(before, every_array(world.model)) == []


@needs_package
def test_every_look_out_of_turn_makes_the_later_ones_earlier(substrate: LiberoSubstrate) -> None:
    """A variation, a setup and an event are three, whatever each of them alters."""
    world = substrate.task_world("libero_object", 0, 195).varied(ProVariation("camera_view_angle"))
    world.reset(0)
    world.park("milk_1", (-2.0, 0.0, -5.0))
    world.park("butter_1", (-2.2, 0.0, -5.0))
    world.step(NOOP_ACTION)
    assert world._sample_at == 22
    world.alter("light_diffuse", slice(None), 0.1)
    world.alter("light_ambient", slice(None), 0.1)
    world.step(NOOP_ACTION)
    world.step(NOOP_ACTION)
    assert world._sample_at == 21


@needs_package
@pytest.mark.skipif(not OFFICIAL.exists(), reason="needs the authors' 800 cases in ../shared/official")
def test_official_cases_find_their_entities(substrate: LiberoSubstrate) -> None:
    cases = [case for case in load_manifest(OFFICIAL) if case.source_category in CATEGORIES]
    assert len(cases) == 320
    chosen = {(case.suite, case.task_index): case for case in cases}
    for (suite, index), case in sorted(chosen.items())[::6]:
        world = substrate.world(case)
        named = {case.event.trigger.entity, *(item["object"] for item in case.event.setup)}
        assert named <= set(world.entities), (suite, index)
        world.reset(case.init_state_index)
