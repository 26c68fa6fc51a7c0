from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import EntityError, SubstrateError
from pytest_libero_max.substrates.embedded.panda import outline
from pytest_libero_max.substrates.embedded.scene import build_scene
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate, EmbeddedWorld
from pytest_libero_max.worlds.contract import World
from pytest_libero_max.worlds.robot import NOOP_ACTION, PANDA
from tests.worlds.reference import twin
from tests.worlds.states import differing, every_array, random_actions

TABLE, FLOOR = ("libero_spatial", 0), ("libero_object", 0)


@pytest.fixture(scope="module")
def table() -> EmbeddedWorld:
    return EmbeddedWorld(build_scene(*TABLE))


@pytest.fixture(scope="module")
def floor() -> EmbeddedWorld:
    return EmbeddedWorld(build_scene(*FLOOR))


def drawn_triangles(model: mujoco.MjModel) -> int:
    meshes = (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH) & (model.geom_group == 1)
    robot = [
        model.body(int(body)).name.startswith(("robot0", "gripper0", "mount0")) for body in model.geom_bodyid
    ]
    return int(model.mesh_facenum[model.geom_dataid[meshes & robot]].sum())


def test_embedded_world_is_a_world(table: EmbeddedWorld) -> None:
    assert isinstance(table, World)
    assert table.scene == "embedded/libero_spatial/0"
    assert table.language.startswith("pick up the black bowl between")


@pytest.mark.parametrize(
    ("task", "base", "hand"),
    [(TABLE, (-0.66, 0.0, 0.912), (-0.2085, 0.0, 1.1733)), (FLOOR, (-0.6, 0.0, 0.0), (-0.1485, 0.0, 0.2613))],
)
def test_the_panda_stands_where_liberos_does(
    task: tuple[str, int], base: tuple[float, ...], hand: tuple[float, ...]
) -> None:
    scene = build_scene(*task)
    world = EmbeddedWorld(scene)
    data = mujoco.MjData(world.model)
    data.qpos[:7] = PANDA.home_rad
    mujoco.mj_kinematics(world.model, data)
    assert data.body("robot0_base").xpos.tolist() == list(base)
    assert data.site("gripper0_grip_site").xpos == pytest.approx(hand, abs=1e-4)


def test_the_panda_has_liberos_joints(table: EmbeddedWorld) -> None:
    model = table.model
    assert model.dof_armature[:7] == pytest.approx([5.0 / n for n in range(1, 8)])
    assert model.dof_damping[:7] == pytest.approx([0.1] * 5 + [0.01] * 2)
    assert model.dof_frictionloss[:9] == pytest.approx([0.1] * 7 + [1.0] * 2)
    assert (model.dof_armature[7:9].tolist(), model.dof_damping[7:9].tolist()) == ([1.0] * 2, [100.0] * 2)
    assert model.actuator_ctrlrange[:, 1].tolist() == [80.0] * 5 + [12.0] * 2 + [0.04, 0.0]
    assert model.jnt_range[1].tolist() == [-1.7628, 1.7628]
    options = model.opt
    assert (options.timestep, options.impratio, options.density) == (0.002, 20.0, 1.2)
    assert (options.integrator, options.cone) == (
        mujoco.mjtIntegrator.mjINT_EULER,
        mujoco.mjtCone.mjCONE_ELLIPTIC,
    )


def test_the_scene_has_every_part_that_the_robot_names(table: EmbeddedWorld) -> None:
    model = table.model
    assert [model.joint(name).id for name in (*PANDA.arm_joints, *PANDA.finger_joints)] == list(range(9))
    assert all(model.body(name).id > 0 for name in (PANDA.base_body, PANDA.hand_body))
    assert model.site(PANDA.grip_site).id == table._grip_site
    assert model.body(PANDA.hand_body).id == table._hand_body
    sizes = {name: value.size for name, value in table.observe(cameras=()).items()}
    assert sizes == PANDA.state


def test_the_robot_is_light_to_draw_and_complete(table: EmbeddedWorld) -> None:
    assert 1000 < drawn_triangles(table.model) < 5000
    drawn = {
        table.model.body(int(body)).name for body in table.model.geom_bodyid[table.model.geom_group == 1]
    }
    links = {f"robot0_link{number}" for number in range(8)}
    assert links | {"gripper0_leftfinger", "gripper0_rightfinger", "gripper0_right_gripper"} <= drawn


def test_no_marker_is_drawn(table: EmbeddedWorld) -> None:
    assert not table.model.site_rgba[:, 3].any()


def test_the_fingers_are_in_the_wrist_view(table: EmbeddedWorld) -> None:
    table.reset(0)
    opened = table.observe(["robot0_eye_in_hand"], 128)["robot0_eye_in_hand_image"].astype(int)
    for _ in range(8):
        table.step((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    closed = table.observe(["robot0_eye_in_hand"], 128)["robot0_eye_in_hand_image"].astype(int)
    changed = np.abs(opened - closed).max(axis=-1) > 30
    assert changed[:64].sum() > 100  # they close in the lower half of the upright picture


def test_observations_are_robosuites(table: EmbeddedWorld) -> None:
    table.reset(2)
    env = twin(build_scene(*TABLE), table)
    expected = env._get_observations(force_update=True)
    seen = table.observe(cameras=())
    assert sorted(seen) == [
        "robot0_eef_pos",
        "robot0_eef_quat",
        "robot0_gripper_qpos",
        "robot0_gripper_qvel",
        "robot0_joint_pos",
        "robot0_joint_vel",
    ]
    for key in set(seen) - {"robot0_joint_pos"}:
        assert np.array_equal(seen[key], expected[key]), key
    assert np.array_equal(np.cos(seen["robot0_joint_pos"]), expected["robot0_joint_pos_cos"])
    assert np.array_equal(table.end_effector(), expected["robot0_eef_pos"])


@pytest.mark.parametrize("task", [TABLE, FLOOR])
def test_reset_leaves_no_trace_of_an_episode(task: tuple[str, int]) -> None:
    world, fresh = EmbeddedWorld(build_scene(*task)), EmbeddedWorld(build_scene(*task))
    compiled = every_array(world.model)
    for action in random_actions(0, 4):
        world.step(action)
    movable = [name for name, entity in world.entities.items() if entity.kind == "object"]
    fixed = [name for name, entity in world.entities.items() if entity.kind == "fixture"]
    world.park(movable[0], (-2.0, 0.0, -5.0))
    world.place(movable[1], (0.0, 0.0, 1.5))
    for name in fixed:
        world.place(name, world.position(name) * 1.1)
    for field in ("cam_pos", "cam_fovy", "light_diffuse", "geom_rgba", "mat_rgba"):
        world.alter(field, slice(None), getattr(world.model, field) * 0.5)
    for action in random_actions(1, 4):
        world.step(action)
    # An initial state that was never asked for is laid out in the scene as it was compiled.
    world.reset(1)
    fresh.reset(1)
    assert differing(compiled, every_array(world.model)) == []
    for action in random_actions(2, 6):
        assert world.digest() == fresh.digest()
        world.step(action)
        fresh.step(action)
    assert world.digest() == fresh.digest()


def test_a_parked_object_keeps_still_beside_a_moving_arm(floor: EmbeddedWorld) -> None:
    floor.reset(0)
    name = next(name for name, entity in floor.entities.items() if entity.kind == "object")
    at, orientation = floor.pose(name)
    floor.park(name, (-2.0, 0.0, -5.0))
    parked = np.concatenate(floor.pose(name))
    for action in random_actions(5, 20):
        floor.step(action)
        assert np.array_equal(np.concatenate(floor.pose(name)), parked)
        assert floor.contacts(name) == ()
    floor.unpark(name, at)
    assert np.array_equal(np.concatenate(floor.pose(name)), np.concatenate([at, orientation]))
    for _ in range(3):
        floor.step(NOOP_ACTION)
    assert floor.position(name) == pytest.approx(at, abs=1e-3)


def case_of(source: str, suite: str, index: int) -> Case:
    """The part of a case that chooses its world."""
    fields = {
        "case_id": "a-case",
        "source": source,
        "unmodified": source == "libero",
        "source_category": "Any",
        "suite": suite,
        "task_index": index,
    }
    return cast(Case, SimpleNamespace(**fields))


def test_a_substrate_builds_a_scene_once() -> None:
    substrate = EmbeddedSubstrate()
    world = substrate.world(case_of("libero", *FLOOR))
    assert world is substrate.world(case_of("libero", *FLOOR))
    assert world.scene == "embedded/libero_object/0"
    assert set(substrate.fingerprint()) >= {"substrate", "mujoco", "robosuite", "numpy", "gl", "blas"}
    substrate.close()


def test_a_case_that_is_not_built_is_refused() -> None:
    substrate = EmbeddedSubstrate()
    with pytest.raises(SubstrateError, match="libero_90"):
        substrate.world(case_of("libero", "libero_90", 0))


def test_an_outline_keeps_the_farthest_corners() -> None:
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)])
    inside = np.random.default_rng(0).uniform(-0.9, 0.9, (50, 3))
    kept = outline(np.concatenate([inside, corners]), 60)
    assert {tuple(point) for point in kept} == {tuple(corner) for corner in corners}


def fingers_by_name(world: EmbeddedWorld, entity: str) -> set[str]:
    """The fingers in contact with an entity, from the names of the bodies."""
    model, data = world.model, world.data
    root = model.body(world.entities[entity].body).id
    parts = {"leftfinger": "left", "joint1_tip": "left", "rightfinger": "right", "joint2_tip": "right"}
    found = set()
    for pair in data.contact.geom[: data.ncon]:
        bodies = model.geom_bodyid[pair]
        if root in model.body_rootid[bodies]:
            names = [model.body(int(body)).name for body in bodies]
            found |= {side for part, side in parts.items() if any(name.endswith(part) for name in names)}
    return found


def test_the_fingers_that_touch_an_object_are_counted(table: EmbeddedWorld) -> None:
    table.reset(0)
    grip = table.end_effector()
    seen = set()
    for offset in np.linspace(-0.12, 0.12, 25):
        table.place("akita_black_bowl_1", np.add(grip, (0.0, offset, -0.02)))
        fingers = fingers_by_name(table, "akita_black_bowl_1")
        assert table.fingers_on("akita_black_bowl_1") == len(fingers)
        seen.add(frozenset(fingers))
    assert {frozenset(), frozenset({"left"}), frozenset({"right"}), frozenset({"left", "right"})} <= seen
    assert table.fingers_on("plate_1") == 0
    with pytest.raises(EntityError, match="akita_black_bowl"):
        table.fingers_on("akita_black_bowl")
