from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from tests.substrates.libero.data import needs_package

pytestmark = needs_package


@pytest.mark.parametrize(
    ("suite", "task", "cabinet"),
    [("libero_goal", 0, "wooden_cabinet_1"), ("libero_10", 3, "white_cabinet_1")],
)
def test_a_drawer_opens_towards_whoever_holds_its_handle(
    substrate: LiberoSubstrate, suite: str, task: int, cabinet: str
) -> None:
    world = substrate.task_world(suite, task, 0)
    for level in ("top", "middle", "bottom"):
        handle = world.graspable_parts[f"{cabinet}_{level}_level_handle"]
        assert handle.joint in world.joints(f"{cabinet}_{level}_region")
        position, along, out = handle.world(world.data)
        assert abs(along @ out) < 1e-9
        assert abs(along[2]) < 1e-3
        assert handle.width < 0.03
        (low, _), joint = world.model.joint(handle.joint).range, world.data.joint(handle.joint)
        way = handle.motion(world.data) * (low - joint.qpos[0])
        assert np.isclose(way @ out, joint.qpos[0] - low, atol=1e-6)
        start = joint.qpos[0]
        joint.qpos[0] = low
        mujoco.mj_kinematics(world.model, world.data)
        assert np.allclose(handle.world(world.data)[0], position + way, atol=1e-6)
        joint.qpos[0] = start
        mujoco.mj_kinematics(world.model, world.data)


def test_a_knob_is_held_on_its_axis(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_goal", 7, 0)
    knob = world.graspable_parts["flat_stove_1_button_knob"]
    position, along, out = knob.world(world.data)
    assert np.allclose(out, (0.0, 0.0, 1.0))
    assert abs(along[2]) < 1e-3
    assert np.allclose(knob.motion(world.data), 0.0, atol=1e-9)
    anchor = world.data.joint(knob.joint).xanchor
    assert np.allclose(position[:2], anchor[:2])
    assert position[2] > anchor[2]


def test_what_has_no_joint_has_no_part_to_hold(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_10", 5, 0)
    assert world.joints("desk_caddy_1") == ()
    assert {part.entity for part in world.graspable_parts.values()} == {"white_yellow_mug_1"}


def test_pots_and_mugs_are_held_where_their_boxes_are(substrate: LiberoSubstrate) -> None:
    for task, held in ((8, ("moka_pot_1", "moka_pot_2")), (4, ("white_yellow_mug_1",))):
        world = substrate.task_world("libero_10", task, 0)
        world.reset(0)
        parts = [part for part in world.graspable_parts.values() if part.entity in held]
        assert {part.entity for part in parts} == set(held)
        for part in parts:
            position, along, out = part.world(world.data)
            assert abs(along @ out) < 1e-9
            upright = part.name.endswith("handle")
            assert np.allclose((along if upright else out)[2], 1.0, atol=0.05), part.name
            boxes = [int(geom) for geom in world.geoms(part.entity) if world.model.geom_group[geom] == 0]
            inside = [
                np.abs((position - world.data.geom_xpos[box]) @ world.data.geom_xmat[box].reshape(3, 3))
                <= world.model.geom_size[box] + 1e-3
                for box in boxes
            ]
            assert any(one.all() for one in inside), part.name


def test_a_door_is_pushed_from_outside_the_fixture_it_closes(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_10", 9, 0)
    (joint,) = world.joints("microwave_1")
    world.data.joint(joint).qpos[0] = 0.0
    mujoco.mj_kinematics(world.model, world.data)
    handle = world.graspable_parts[f"{joint}_handle"]
    position, _, out = handle.world(world.data)
    assert abs(out[2]) < 1e-6
    assert (position - world.position("microwave_1")) @ out > 0.1
    low, _ = world.model.joint(joint).range
    assert (handle.motion(world.data) * low) @ out > 0.2  # it opens outwards
