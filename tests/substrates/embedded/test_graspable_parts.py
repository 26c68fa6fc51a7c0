"""Handles and knobs: where they are said to be, and that what they are fixed to follows them."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from pytest_libero_max.substrates.embedded.scene import graspable_parts

from .scenes import ALL, IDS, at_start

MOVING = [
    ("libero_goal", 0, name)
    for name in (
        "wooden_cabinet_1_top_handle",
        "wooden_cabinet_1_middle_handle",
        "wooden_cabinet_1_bottom_handle",
        "flat_stove_1_knob",
    )
] + [("libero_10", 9, "microwave_1_door_handle")]
FINGER_HALF = 0.009


@pytest.mark.parametrize(("suite", "index"), ALL, ids=IDS)
def test_every_part_is_inside_the_solids_of_its_body_or_between_them(suite: str, index: int) -> None:
    scene, model, data = at_start(suite, index)
    for name, part in graspable_parts(scene).items():
        assert name.startswith(f"{part.entity}_")
        assert part.width < 0.08
        position, along, out = part.world(data)
        assert np.linalg.norm(along) == pytest.approx(1)
        assert np.linalg.norm(out) == pytest.approx(1)
        assert along @ out == pytest.approx(0, abs=1e-9)
        body = model.body(part.body).id
        solids = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_contype[g]]
        assert any(inside(model, data, g, position) for g in solids), name


def inside(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> bool:
    local = data.geom_xmat[geom].reshape(3, 3).T @ (point - data.geom_xpos[geom])
    return bool((np.abs(local) <= model.geom_size[geom] + 1e-6).all())


@pytest.mark.parametrize(("suite", "index", "name"), MOVING, ids=[name for _, _, name in MOVING])
def test_the_motion_of_a_part_is_that_of_its_joint(suite: str, index: int, name: str) -> None:
    scene, model, data = at_start(suite, index)
    part = graspable_parts(scene)[name]
    before, motion = part.world(data)[0], part.motion(data)
    data.joint(part.joint).qpos[0] -= 1e-6
    mujoco.mj_kinematics(model, data)
    assert (before - part.world(data)[0]) / 1e-6 == pytest.approx(motion, abs=1e-4)


@pytest.mark.parametrize(("suite", "index", "name"), MOVING, ids=[name for _, _, name in MOVING])
def test_two_fingers_reach_around_the_part(suite: str, index: int, name: str) -> None:
    scene, model, data = at_start(suite, index)
    part = graspable_parts(scene)[name]
    position, along, out = part.world(data)
    across = np.cross(along, out)
    for side in (-1.0, 1.0):
        for depth in (0.0, 0.015):
            finger = position + side * (part.width / 2 + FINGER_HALF) * across + depth * out
            assert free(model, data, finger), (name, side, depth)


def free(model: mujoco.MjModel, data: mujoco.MjData, point: np.ndarray) -> bool:
    return not any(inside(model, data, g, point) for g in range(model.ngeom) if model.geom_contype[g])


@pytest.mark.parametrize(("suite", "index", "name"), MOVING, ids=[name for _, _, name in MOVING])
def test_a_small_force_moves_it_and_it_stays_where_it_was_left(suite: str, index: int, name: str) -> None:
    scene, model, data = at_start(suite, index)
    joint = model.joint(graspable_parts(scene)[name].joint)
    data.qpos[joint.qposadr[0]] = 0.0
    for thing in scene.task.objects:
        data.joint(f"{thing}_joint0").qpos[0] += 5.0  # out of the way
    opening = -1.0 if abs(joint.range[0]) > joint.range[1] else 1.0
    force = 20.0 if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE else 0.3  # N or Nm
    dof, place = joint.dofadr[0], joint.qposadr[0]
    start = data.qpos[place]
    data.qfrc_applied[dof] = opening * force
    mujoco.mj_step(model, data, 500)
    assert opening * (data.qpos[place] - start) > 0.15
    data.qfrc_applied[dof] = 0.0
    mujoco.mj_step(model, data, 250)
    rest = data.qpos[place]
    mujoco.mj_step(model, data, 500)
    assert data.qpos[place] == pytest.approx(rest, abs=1e-4)


def test_grips_of_objects_are_given_in_the_turned_frame_of_their_bodies() -> None:
    scene, _, data = at_start("libero_goal", 9)
    neck = graspable_parts(scene)["wine_bottle_1_neck"]
    position, along, _ = neck.world(data)
    assert abs(along) == pytest.approx([1, 0, 0], abs=1e-3)
    offset = position - data.body("wine_bottle_1_main").xpos
    assert offset == pytest.approx([0, 0, 0.136], abs=1e-3)
