"""Sizes and masses of every object, against those of LIBERO's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.embedded.objects import CATEGORIES, category
from pytest_libero_max.worlds import rotations
from pytest_libero_max.worlds.contract import Array, Entity

from .scenes import ALL, at_start

# Mass in kg; depth, width and height in m as it stands at reset.
LIBERO = {
    "akita_black_bowl": (0.005591, (0.1070, 0.1072, 0.0505)),
    "alphabet_soup": (0.025851, (0.0629, 0.0625, 0.0762)),
    "basket": (0.136107, (0.1573, 0.1695, 0.1415)),
    "black_book": (0.042547, (0.0287, 0.1104, 0.1344)),
    "bbq_sauce": (0.012180, (0.0291, 0.0470, 0.1071)),
    "butter": (0.005247, (0.0762, 0.0395, 0.0174)),
    "chefmate_8_frypan": (0.050247, (0.2044, 0.3561, 0.0579)),
    "chocolate_pudding": (0.010186, (0.0802, 0.0463, 0.0274)),
    "cookies": (0.009643, (0.0826, 0.0621, 0.0188)),
    "cream_cheese": (0.006194, (0.0812, 0.0427, 0.0179)),
    "desk_caddy": (0.277963, (0.1510, 0.4338, 0.1669)),
    "flat_stove": (4.480100, (0.2970, 0.1900, 0.0700)),
    "glazed_rim_porcelain_ramekin": (0.009660, (0.0891, 0.0893, 0.0420)),
    "ketchup": (0.023217, (0.0368, 0.0562, 0.1456)),
    # LIBERO's oven is 0.1885 m high and hovers 20 mm above the table; ours stands on feet.
    "microwave": (3.260000, (0.3450, 0.2630, 0.1885 + 0.0200)),
    "milk": (0.031666, (0.0525, 0.0531, 0.1312)),
    "moka_pot": (0.068243, (0.0814, 0.1475, 0.1518)),
    "orange_juice": (0.031666, (0.0525, 0.0531, 0.1312)),
    "plate": (0.011522, (0.1375, 0.1376, 0.0190)),
    "porcelain_mug": (0.016463, (0.0963, 0.1246, 0.1061)),
    "red_coffee_mug": (0.029353, (0.0932, 0.1229, 0.1327)),
    "salad_dressing": (0.021785, (0.0355, 0.0527, 0.1456)),
    "tomato_sauce": (0.026633, (0.0627, 0.0618, 0.0762)),
    "white_cabinet": (9.176239, (0.2546, 0.2210, 0.2184)),
    "white_yellow_mug": (0.030912, (0.1061, 0.1397, 0.1032)),
    "wine_bottle": (0.015394, (0.0426, 0.0442, 0.1569)),
    # LIBERO's rack is 0.3304 m high and hovers 18 mm above the table; ours stands on feet.
    "wine_rack": (0.152748, (0.2688, 0.2538, 0.3304 + 0.0178)),
    "wooden_cabinet": (9.176239, (0.2546, 0.2210, 0.2184)),
}
JOINTS = {
    "wooden_cabinet_1_top_level": ([-0.16, 0.01], [0, 1, 0], 50.0),
    "wooden_cabinet_1_middle_level": ([-0.16, 0.01], [0, 1, 0], 50.0),
    "wooden_cabinet_1_bottom_level": ([-0.16, 0.01], [0, 1, 0], 50.0),
    "flat_stove_1_button": ([-0.005, 2.1], [0, 0, 1], 1.0),
}
JOINTS_OF_10 = {
    "white_cabinet_1_top_level": (3, [-0.16, 0.01], [0, 1, 0], 50.0),
    "white_cabinet_1_middle_level": (3, [-0.16, 0.01], [0, 1, 0], 50.0),
    "white_cabinet_1_bottom_level": (3, [-0.16, 0.01], [0, 1, 0], 50.0),
    "microwave_1_microjoint": (9, [-2.094, 0.0], [0, 0, 1], 0.5),
}


def first_scene_with(name: str) -> tuple[Entity, mujoco.MjModel, mujoco.MjData]:
    for suite, index in ALL:
        scene, model, data = at_start(suite, index)
        for entity in scene.entities.values():
            if entity.category == name:
                for joint in joints_of(name, model):
                    data.joint(joint).qpos[0] = 0.0  # sizes are those with drawers and doors shut
                mujoco.mj_forward(model, data)
                return entity, model, data
    raise AssertionError(f"no scene has a {name}")


def joints_of(name: str, model: mujoco.MjModel) -> list[str]:
    names = [
        model.joint(n).name for n in range(model.njnt) if model.jnt_type[n] != mujoco.mjtJoint.mjJNT_FREE
    ]
    return [joint for joint in names if joint.startswith(f"{name}_1_")]


def designed_axes(data: mujoco.MjData, body: str, name: str) -> Array:
    """(3, 3): in the world, the axes in which a category is designed."""
    axes: Array = data.body(body).xmat.reshape(3, 3)
    return axes @ rotations.matrix(rotations.inverse(category(name).upright))


def geoms_of(model: mujoco.MjModel, body: str) -> list[int]:
    return [int(g) for g in np.flatnonzero(model.body_rootid[model.geom_bodyid] == model.body(body).id)]


def extent(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int], yaw_free: Array) -> Array:
    """(3,) m, size of the box around geoms, in the axes of ``yaw_free``."""
    points = []
    for g in geoms:
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[g]
            start = model.mesh_vertadr[mesh]
            local = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
        else:
            signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
            local = signs * model.geom_size[g]
        points.append(local @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])
    cloud = np.concatenate(points) @ yaw_free
    size: Array = cloud.max(axis=0) - cloud.min(axis=0)
    return size


def test_the_table_covers_every_category() -> None:
    assert sorted(LIBERO) == list(CATEGORIES)


@pytest.mark.parametrize("name", sorted(LIBERO))
def test_mass_and_size_are_those_of_libero(name: str) -> None:
    mass, size = LIBERO[name]
    entity, model, data = first_scene_with(name)
    root = model.body(entity.body).id
    assert model.body_mass[model.body_rootid == root].sum() == pytest.approx(mass, rel=1e-4)
    axes = designed_axes(data, entity.body, name)
    geoms = geoms_of(model, entity.body)
    solid = [g for g in geoms if model.geom_contype[g]]
    # 4 mm: the slanted slabs of a plate's rim end a little below and above the edges of its profile.
    assert extent(model, data, solid, axes) == pytest.approx(size, abs=0.004)


@pytest.mark.parametrize("name", sorted(set(LIBERO) - {"flat_stove"}))
def test_what_is_seen_is_where_it_is_felt(name: str) -> None:
    entity, model, data = first_scene_with(name)
    geoms = geoms_of(model, entity.body)
    axes = designed_axes(data, entity.body, name)
    solid = extent(model, data, [g for g in geoms if model.geom_contype[g]], axes)
    seen = extent(model, data, [g for g in geoms if not model.geom_contype[g]], axes)
    assert seen == pytest.approx(solid, abs=0.008)


def test_collision_and_looks_are_in_the_groups_that_robosuite_expects() -> None:
    for suite, index in ALL[::5]:
        _, model, _ = at_start(suite, index)
        colliding = model.geom_contype > 0
        assert (model.geom_group[colliding] == 0).all()
        assert (model.geom_group[~colliding] == 1).all()


def test_drawers_and_knob_move_as_in_libero() -> None:
    _, model, _ = at_start("libero_spatial", 0)
    for name, (limits, axis, damping) in JOINTS.items():
        joint = model.joint(name)
        assert joint.range == pytest.approx(limits)
        assert joint.axis == pytest.approx(axis)
        assert model.dof_damping[joint.dofadr[0]] == damping


def test_drawers_and_door_of_libero_10_move_as_in_libero() -> None:
    for name, (index, limits, axis, damping) in JOINTS_OF_10.items():
        _, model, _ = at_start("libero_10", index)
        joint = model.joint(name)
        assert joint.range == pytest.approx(limits)
        assert joint.axis == pytest.approx(axis)
        assert model.dof_damping[joint.dofadr[0]] == damping


@pytest.mark.parametrize("name", [*(name for name in JOINTS if "level" in name), *JOINTS_OF_10])
def test_a_drawer_or_door_moves_through_its_whole_range_without_touching_anything(name: str) -> None:
    scene = ("libero_10", JOINTS_OF_10[name][0]) if name in JOINTS_OF_10 else ("libero_spatial", 0)
    _, model, data = at_start(*scene)
    drawer = model.joint(name).bodyid[0]
    low, high = model.joint(name).range
    for position in np.linspace(low, high, 18):
        data.joint(name).qpos[0] = position
        mujoco.mj_forward(model, data)
        bodies = model.geom_bodyid[data.contact.geom[: data.ncon]]
        # Things in front of an oven are in its door's way.
        own = (model.body_rootid[bodies] == model.body_rootid[drawer]).all(axis=1)
        assert drawer not in bodies[own]


def test_the_knob_turns_freely() -> None:
    _, model, data = at_start("libero_spatial", 0)
    knob = model.body("flat_stove_1_button").id
    for angle in np.linspace(0, 2.1, 8):
        data.joint("flat_stove_1_button").qpos[0] = angle
        mujoco.mj_forward(model, data)
        bodies = model.geom_bodyid[data.contact.geom[: data.ncon]]
        assert knob not in bodies


def test_an_unknown_category_names_the_closest() -> None:
    with pytest.raises(SubstrateError, match="Did you mean 'plate'"):
        category("plat")
