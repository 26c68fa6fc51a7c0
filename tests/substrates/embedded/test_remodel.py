"""Scenes with something more or something else in them."""

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.embedded.objects import CATEGORIES, category
from pytest_libero_max.substrates.embedded.objects.parts import Link, links
from pytest_libero_max.substrates.embedded.objects.restyled import SMALL, STYLES
from pytest_libero_max.substrates.embedded.remodel import Remodel, remodelled
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.surfaces import SURFACES, shown

BASE = build_scene("libero_spatial", 0)
RELATIVES = sorted(name for name, style in STYLES.items() if style.original in CATEGORIES)


def test_a_plan_is_read_from_json_and_has_a_name_of_its_own() -> None:
    plan = Remodel.from_dict({"extras": [["milk_1", "milk"]], "surfaces": ["cork"]})
    assert plan == Remodel(extras=(("milk_1", "milk"),), surfaces=("cork",))
    assert plan.key != Remodel(surfaces=("cork",)).key != Remodel().key == ""
    with pytest.raises(SubstrateError, match="Did you mean 'extras'"):
        Remodel.from_dict({"extra": []})


def test_nothing_else_changes_when_something_is_added() -> None:
    scene = remodelled(BASE, Remodel(extras=(("milk_1", "milk"),), surfaces=("cork",)))
    before, after = (mujoco.MjModel.from_xml_string(s.mjcf) for s in (BASE, scene))
    assert after.nq == before.nq + 7
    assert set(scene.entities) == {*BASE.entities, "milk_1"}
    assert scene.entities["milk_1"].support == "main_table"
    assert set(scene.textures) == {*BASE.textures, "milk_label", shown("cork")}
    for body in range(before.nbody):
        name = before.body(body).name
        assert np.array_equal(before.body(body).inertia, after.body(name).inertia)
        assert np.array_equal(before.body(body).pos, after.body(name).pos)


def test_what_is_recast_takes_over_name_place_regions_and_goal() -> None:
    plan = Remodel(
        recast=(("plate_1", "yellow_plate_1", "yellow_plate"), ("flat_stove_1", "s_1", "yellow_stove"))
    )
    scene = remodelled(BASE, plan)
    model = mujoco.MjModel.from_xml_string(scene.mjcf)
    assert "plate_1" not in scene.entities
    assert scene.entities["yellow_plate_1"].category == "yellow_plate"
    assert scene.task.goal[0].place == "yellow_plate_1"
    assert scene.regions["s_1_cook_region"].target == "s_1"
    assert plan.renamed("flat_stove_1_button") == "s_1_button"
    assert model.joint("s_1_button").id >= 0
    before = mujoco.MjModel.from_xml_string(BASE.mjcf)
    assert np.array_equal(model.body("s_1_main").pos, before.body("flat_stove_1_main").pos)


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        (Remodel(extras=(("plate_1", "plate"),)), "in the scene already"),
        (Remodel(recast=(("plat_1", "x_1", "plate"),)), "Did you mean 'plate_1'"),
        (Remodel(recast=(("plate_1", "cookies_1", "plate"),)), "in the scene already"),
        (Remodel(recast=(("main_table", "x_1", "plate"),)), "cannot be replaced"),
        (Remodel(surfaces=("corck",)), "Did you mean 'cork'"),
        (Remodel(extras=(("cup_1", "cup"),)), "category='cup'"),
    ],
)
def test_what_cannot_be_built_is_named(plan: Remodel, message: str) -> None:
    with pytest.raises(SubstrateError, match=message):
        remodelled(BASE, plan)


def half_sizes(link: Link) -> list[float]:
    return [part for each in links(link) for solid in each.solids for part in solid.half]


@pytest.mark.parametrize("name", [*RELATIVES, *(SMALL + name for name in CATEGORIES)])
def test_relatives_compile_and_keep_the_shape_of_their_originals(name: str) -> None:
    kind = category(name)
    original = category(STYLES[name].original if name in STYLES else name.removeprefix(SMALL))
    assert kind.name == name
    assert len(half_sizes(kind.root)) == len(half_sizes(original.root))
    assert [len(link.skins) for link in links(kind.root)] == [
        len(link.skins) for link in links(original.root)
    ]
    assert [site.name for link in links(kind.root) for site in link.sites] == [
        site.name for link in links(original.root) for site in link.sites
    ]
    assert [link.joint for link in links(kind.root)] == [link.joint for link in links(original.root)]


@pytest.mark.parametrize("name", ["akita_black_bowl", "milk", "butter"])
def test_a_small_object_is_small_in_every_direction(name: str) -> None:
    small, original = category(SMALL + name), category(name)
    assert half_sizes(small.root) == pytest.approx([0.7 * part for part in half_sizes(original.root)])
    assert small.root.mass == pytest.approx(0.343 * original.root.mass)
    assert small.origin_height == pytest.approx(0.7 * original.origin_height)


def test_a_small_fixture_keeps_the_way_its_drawers_go() -> None:
    small, original = category(SMALL + "wooden_cabinet"), category("wooden_cabinet")
    widths = [[s.half[0] for link in links(k.root) for s in link.solids] for k in (small, original)]
    depths = [[s.half[1] for link in links(k.root) for s in link.solids] for k in (small, original)]
    assert widths[0] == pytest.approx([0.85 * w for w in widths[1]])
    assert depths[0] == depths[1]


@pytest.mark.parametrize("name", [name for name in RELATIVES if STYLES[name].colour is not None])
def test_a_coloured_relative_is_of_that_colour(name: str) -> None:
    colour = np.asarray(STYLES[name].colour)
    pictures = [draw() for draw in category(name).textures.values()]
    for picture in pictures:
        mean = picture.reshape(-1, 3).mean(axis=0)
        assert mean / mean.max() == pytest.approx(colour / colour.max(), abs=0.06)


@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_is_a_picture_that_tiles_and_is_drawn_the_same_every_time(name: str) -> None:
    picture = SURFACES[name]()
    assert picture.shape == (256, 256, 3)
    assert picture.dtype == np.uint8
    assert np.array_equal(picture, SURFACES[name]())
    steps = np.abs(np.diff(picture.astype(float), axis=0)).mean(axis=(1, 2))
    seam = np.abs(picture[0].astype(float) - picture[-1]).mean()
    assert seam <= steps.max() + 12.0


def test_surfaces_differ() -> None:
    means = np.array([SURFACES[name]().reshape(-1, 3).mean(axis=0) for name in SURFACES])
    spreads = np.array([SURFACES[name]().reshape(-1, 3).std(axis=0) for name in SURFACES])
    looks = np.hstack([means, spreads])
    away = np.linalg.norm(looks[:, None] - looks[None], axis=2) + 1e9 * np.eye(len(looks))
    assert away.min() > 8.0
