from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.worlds.embedded.predicates import In, Joints, OnObject, OnSite
from pytest_libero_max.worlds.embedded.scene import build_scene, resolve
from pytest_libero_max.worlds.embedded.tasks import Fact
from pytest_libero_max.worlds.embedded.textures import upload
from pytest_libero_max.worlds.rendering import Renderer

from .scenes import ALL, IDS, at_start, compiled

every_scene = pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)


@every_scene
def test_every_name_of_the_scene_exists_in_the_model(suite, index):
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


@every_scene
def test_a_scene_is_light_and_casts_no_shadows(suite, index):
    _, model = compiled(suite, index)
    shown = model.geom_dataid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    assert model.mesh_facenum[shown].sum() < 6000
    assert not model.light_castshadow.any()
    assert not model.mat_reflectance.any()


def test_joints_come_in_liberos_order():
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


def test_cameras_stand_where_libero_has_them():
    for suite, position in (
        ("libero_spatial", (0.658613, 0, 1.61035)),
        ("libero_object", (0.896577, 0, 0.65)),
    ):
        _, model = compiled(suite, 0)
        names = {model.camera(n).name for n in range(model.ncam)}
        assert names == {"agentview", "frontview", "birdview", "galleryview", "sideview"}
        assert model.camera("agentview").pos == pytest.approx(position, abs=1e-5)
        assert model.camera("agentview").fovy == 45


def test_robot_goes_where_libero_has_it():
    table, floor = build_scene("libero_spatial", 0), build_scene("libero_object", 0)
    assert (table.mount, table.robot_base_pos) == ("rethink", (-0.66, 0.0, 0.912))
    assert (floor.mount, floor.robot_base_pos) == ("ground", (-0.6, 0.0, 0.0))


def test_the_same_task_gives_the_same_bytes():
    first, second = build_scene("libero_spatial", 4), build_scene("libero_spatial", 4)
    assert first.mjcf == second.mjcf
    assert all((first.textures[name] == second.textures[name]).all() for name in first.textures)


def test_the_document_needs_no_file():
    root = ET.fromstring(build_scene("libero_object", 0).mjcf)
    assert not [element.tag for element in root.iter() if element.get("file")]


def test_entities_say_what_they_rest_on():
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


def test_names_become_predicates():
    scene = build_scene("libero_spatial", 0)

    def of(*fact: str):
        return resolve(Fact(*fact), scene.entities, scene.regions)

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


def test_a_predicate_about_nothing_is_refused():
    scene = build_scene("libero_spatial", 0)
    with pytest.raises(SubstrateError, match="Did you mean 'plate_1'"):
        resolve(Fact("on", "akita_black_bowl_1", "plate_2"), scene.entities, scene.regions)


@pytest.mark.parametrize("suite", ["libero_spatial", "libero_object"])
def test_the_main_camera_sees_every_object(suite):
    scene, model, data = at_start(suite, 0)
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
