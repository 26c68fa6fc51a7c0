from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Literal

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.embedded.predicates import In, Joints, OnObject, OnSite, Predicate
from pytest_libero_max.substrates.embedded.scene import build_scene, resolve
from pytest_libero_max.substrates.embedded.textures import upload
from pytest_libero_max.worlds.privileged import Fact
from pytest_libero_max.worlds.rendering.renderer import Renderer

from .scenes import ALL, IDS, at_start, compiled

PredicateName = Literal["on", "in", "open", "close", "turnon", "turnoff"]

every_scene = pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)


@every_scene
def test_every_name_of_the_scene_exists_in_the_model(suite: str, index: int) -> None:
    scene, model = compiled(suite, index)
    for entity in scene.entities.values():
        assert model.body(entity.body).id > 0
        if entity.kind == "object":
            assert model.joint(f"{entity.name}_joint0").type == mujoco.mjtJoint.mjJNT_FREE
            assert entity.support in scene.entities
    for region in scene.regions.values():
        assert model.site(region.name).id >= 0
        assert region.target in scene.entities
        for joint in region.joints:
            assert model.joint(joint).id >= 0
    for name, picture in scene.textures.items():
        texture = model.texture(name).id
        assert (model.tex_height[texture], model.tex_width[texture]) == picture.shape[:2]


def triangles(model: mujoco.MjModel) -> int:
    shown = model.geom_dataid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    return int(model.mesh_facenum[shown].sum())


def test_no_scene_has_more_than_twice_the_median_of_triangles_or_of_colliding_shapes() -> None:
    models = [compiled(suite, index)[1] for suite, index in ALL]
    for counts in (
        [triangles(model) for model in models],
        [int((model.geom_contype > 0).sum()) for model in models],
    ):
        assert max(counts) <= 2 * np.median(counts)


@every_scene
def test_a_scene_is_light_and_casts_no_shadows(suite: str, index: int) -> None:
    _, model = compiled(suite, index)
    assert triangles(model) < 6000
    assert not model.light_castshadow.any()
    assert not model.mat_reflectance.any()


def test_joints_come_in_liberos_order() -> None:
    _, spatial = compiled("libero_spatial", 7)
    assert [spatial.joint(n).name for n in range(spatial.njnt)] == [
        "akita_black_bowl_1_joint0",
        "akita_black_bowl_2_joint0",
        "cookies_1_joint0",
        "glazed_rim_porcelain_ramekin_1_joint0",
        "plate_1_joint0",
        "wooden_cabinet_1_top_level",
        "wooden_cabinet_1_middle_level",
        "wooden_cabinet_1_bottom_level",
        "flat_stove_1_button",
    ]
    _, groceries = compiled("libero_object", 4)
    assert [groceries.joint(n).name for n in range(groceries.njnt)] == [
        f"{name}_1_joint0"
        for name in (
            "ketchup",
            "basket",
            "bbq_sauce",
            "salad_dressing",
            "alphabet_soup",
            "cream_cheese",
            "milk",
        )
    ]
    for (suite, index), names in JOINTS.items():
        _, model = compiled(suite, index)
        free = mujoco.mjtJoint.mjJNT_FREE
        found = [(model.joint(n).name, model.jnt_type[n] == free) for n in range(model.njnt)]
        assert [name.removesuffix("_joint0") for name, _ in found] == names.split()
        assert all(name.endswith("_joint0") == moves for name, moves in found)


JOINTS = {
    ("libero_goal", 3): "akita_black_bowl_1 cream_cheese_1 wine_bottle_1 plate_1 wooden_cabinet_1_top_level "
    "wooden_cabinet_1_middle_level wooden_cabinet_1_bottom_level flat_stove_1_button",
    (
        "libero_10",
        0,
    ): "alphabet_soup_1 cream_cheese_1 tomato_sauce_1 ketchup_1 orange_juice_1 milk_1 butter_1 basket_1",
    (
        "libero_10",
        1,
    ): "alphabet_soup_1 cream_cheese_1 tomato_sauce_1 ketchup_1 orange_juice_1 milk_1 butter_1 basket_1",
    ("libero_10", 2): "chefmate_8_frypan_1 moka_pot_1 flat_stove_1_button",
    ("libero_10", 3): "akita_black_bowl_1 wine_bottle_1 white_cabinet_1_top_level "
    "white_cabinet_1_middle_level white_cabinet_1_bottom_level",
    ("libero_10", 4): "porcelain_mug_1 red_coffee_mug_1 white_yellow_mug_1 plate_1 plate_2",
    ("libero_10", 5): "black_book_1 white_yellow_mug_1",
    ("libero_10", 6): "porcelain_mug_1 red_coffee_mug_1 plate_1 chocolate_pudding_1",
    ("libero_10", 7): "alphabet_soup_1 cream_cheese_1 tomato_sauce_1 ketchup_1 basket_1",
    ("libero_10", 8): "moka_pot_1 moka_pot_2 flat_stove_1_button",
    ("libero_10", 9): "porcelain_mug_1 white_yellow_mug_1 microwave_1_microjoint",
}

# A task in each room: the robot's mount and base, agentview, the surface's height, a site and where it is.
ROOMS = {
    ("libero_spatial", 0): (
        "rethink",
        (-0.66, 0.0, 0.912),
        (0.658613, 0, 1.61035),
        0.9,
        ("main_table_plate_region", (0.06, 0.20, 0.895)),
    ),
    ("libero_object", 0): (
        "ground",
        (-0.6, 0.0, 0.0),
        (0.896577, 0, 0.65),
        0.0,
        ("floor_bin_region", (0.0, 0.26, 0.02)),
    ),
    ("libero_10", 0): (
        "ground",
        (-0.51, 0.0, 0.42),
        (0.606577, 0, 0.96),
        0.43676,
        ("living_room_table_alphabet_soup_init_region", (-0.10, -0.15, 0.41)),
    ),
    ("libero_10", 2): (
        "rethink",
        (-0.66, 0.0, 0.912),
        (0.658613, 0, 1.61035),
        0.9,
        ("kitchen_table_flat_stove_init_region", (-0.20, 0.20, 0.875)),
    ),
    ("libero_10", 5): (
        "rethink",
        (-0.75, 0.0, 0.912),
        (0.458613, 0, 1.61035),
        0.88513,
        ("study_table_black_book_init_region", (-0.20, 0.15, 0.867)),
    ),
}
every_room = pytest.mark.parametrize("room", ROOMS, ids=[f"{suite}/{index}" for suite, index in ROOMS])


@every_room
def test_cameras_stand_where_libero_has_them(room: tuple[str, int]) -> None:
    _, model = compiled(*room)
    names = {model.camera(n).name for n in range(model.ncam)}
    extra = {"paperview"} if room[0] == "libero_10" else set()
    assert names == {"agentview", "frontview", "birdview", "galleryview", "sideview"} | extra
    assert model.camera("agentview").pos == pytest.approx(ROOMS[room][2], abs=1e-5)
    assert model.camera("agentview").fovy == 45


@every_room
def test_robot_surface_and_regions_are_where_libero_has_them(room: tuple[str, int]) -> None:
    mount, base, _, height, (name, position) = ROOMS[room]
    scene, model, data = at_start(*room)
    assert (scene.mount, scene.robot_base_pos) == (mount, base)
    assert data.site(name).xpos == pytest.approx(position, abs=1e-6)
    down = np.array([0.0, 0.0, -1.0])
    start = np.array([0.12, -0.01, height + 0.001])  # nothing stands here in any of these scenes
    solid = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    assert mujoco.mj_ray(model, data, start, down, solid, 1, -1, np.zeros(1, np.int32)) == pytest.approx(
        0.001, abs=1e-6
    )


FIXTURES = {
    ("libero_goal", 0): {
        "wooden_cabinet_1": (0.03, -0.24, 0.905),
        "flat_stove_1": (-0.41, 0.21, 0.905),
        "wine_rack_1": (-0.26, -0.26, 0.92),
    },
    ("libero_10", 3): {"white_cabinet_1": (0.0, 0.30, 0.905), "wine_rack_1": (-0.10, -0.30, 0.92)},
    ("libero_10", 5): {"desk_caddy_1": (-0.40, -0.14, 0.887)},
    ("libero_10", 9): {"microwave_1": (0.0, 0.35, 0.92)},
}


@pytest.mark.parametrize(("suite", "index"), FIXTURES, ids=[f"{s}/{i}" for s, i in FIXTURES])
def test_fixtures_stand_in_the_middle_of_their_regions(suite: str, index: int) -> None:
    scene, _, data = at_start(suite, index)
    for name, position in FIXTURES[suite, index].items():
        body = data.body(scene.entities[name].body)
        assert body.xpos == pytest.approx(position, abs=1e-6)
        turned = name.startswith(("wooden_cabinet", "wine_rack", "desk_caddy"))
        assert body.xmat[0] == pytest.approx(-1.0 if turned else 1.0)


def test_the_same_task_gives_the_same_bytes() -> None:
    first, second = build_scene("libero_spatial", 4), build_scene("libero_spatial", 4)
    assert first.mjcf == second.mjcf
    assert all((first.textures[name] == second.textures[name]).all() for name in first.textures)


def test_the_document_needs_no_file() -> None:
    root = ET.fromstring(build_scene("libero_object", 0).mjcf)
    assert not [element.tag for element in root.iter() if element.get("file")]


def test_entities_say_what_they_rest_on() -> None:
    supports = {
        index: build_scene("libero_spatial", index).entities["akita_black_bowl_1"].support
        for index in (0, 3, 4, 5, 7, 9)
    }
    assert supports == {
        0: "main_table",
        3: "cookies_1",
        4: "wooden_cabinet_1",
        5: "glazed_rim_porcelain_ramekin_1",
        7: "flat_stove_1",
        9: "wooden_cabinet_1",
    }


def test_names_become_predicates() -> None:
    scene = build_scene("libero_spatial", 0)

    def of(predicate: PredicateName, subject: str, place: str | None = None) -> Predicate:
        return resolve(Fact(predicate, subject, place), scene.entities, scene.regions)

    bowl = "akita_black_bowl_1_main"
    top = ("wooden_cabinet_1_top_level",)
    assert of("on", "akita_black_bowl_1", "plate_1") == OnObject(bowl, "plate_1_main")
    assert of("on", "akita_black_bowl_1", "flat_stove_1_cook_region") == OnSite(
        bowl, "flat_stove_1_cook_region", "flat_stove_1_main"
    )
    assert of("on", "akita_black_bowl_1", "main_table_box_region") == OnSite(
        bowl, "main_table_box_region", None
    )
    assert of("in", "akita_black_bowl_1", "wooden_cabinet_1_top_region") == In(
        bowl, "wooden_cabinet_1_top_region"
    )
    assert of("open", "wooden_cabinet_1_top_region") == Joints(top, high=-0.14)
    assert of("close", "wooden_cabinet_1_top_region") == Joints(top, low=0.0, every=True)
    assert of("turnon", "flat_stove_1") == Joints(("flat_stove_1_button",), low=0.5, closed=True)
    assert of("turnoff", "flat_stove_1") == Joints(("flat_stove_1_button",), high=0.0, every=True)
    scene = build_scene("libero_10", 9)
    door = ("microwave_1_microjoint",)
    assert of("open", "microwave_1") == Joints(door, high=-1.3)
    assert of("close", "microwave_1") == Joints(door, low=-0.005, every=True)
    assert of("in", "white_yellow_mug_1", "microwave_1_heating_region") == In(
        "white_yellow_mug_1_main", "microwave_1_heating_region"
    )


def test_a_predicate_about_nothing_is_refused() -> None:
    scene = build_scene("libero_spatial", 0)
    with pytest.raises(SubstrateError, match="Did you mean 'plate_1'"):
        resolve(Fact("on", "akita_black_bowl_1", "plate_2"), scene.entities, scene.regions)
    with pytest.raises(SubstrateError, match="predicate='open' means nothing for 'flat_stove_1'"):
        resolve(Fact("open", "flat_stove_1"), scene.entities, scene.regions)
    with pytest.raises(SubstrateError, match="predicate='turnon' means nothing for 'plate_1'"):
        resolve(Fact("turnon", "plate_1"), scene.entities, scene.regions)


@pytest.mark.parametrize(
    ("suite", "index"),
    [("libero_spatial", 0), ("libero_object", 0), ("libero_goal", 0), *(("libero_10", n) for n in range(10))],
)
def test_the_main_camera_sees_every_object(suite: str, index: int) -> None:
    scene, model, data = at_start(suite, index)
    upload(model, scene.textures)
    renderer = Renderer(model, data)
    try:
        whole = renderer.render("agentview", 128)
        for name in scene.task.objects:
            joint = data.joint(f"{name}_joint0")
            place = joint.qpos[:3].copy()
            joint.qpos[:3] = 0.0, 0.0, -2.0
            mujoco.mj_kinematics(model, data)
            without = renderer.render("agentview", 128)
            assert (whole != without).any(axis=2).sum() >= 20, name
            joint.qpos[:3] = place
            mujoco.mj_kinematics(model, data)
        assert (renderer.render("agentview", 128) == whole).all()
    finally:
        renderer.close()
