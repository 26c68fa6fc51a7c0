from __future__ import annotations

import os
from copy import copy
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pytest_libero_max.errors import EntityError, SubstrateError
from pytest_libero_max.substrates.libero.initial_states import read_states
from pytest_libero_max.substrates.libero.installation import Installation
from pytest_libero_max.substrates.libero.package_env import build
from pytest_libero_max.substrates.libero.tasks import task_of
from pytest_libero_max.substrates.libero.world import LiberoWorld
from pytest_libero_max.worlds.contract import Semantics, World
from pytest_libero_max.worlds.privileged import Fact, PrivilegedWorld
from pytest_libero_max.worlds.rendering.renderer import Renderer
from pytest_libero_max.worlds.robot import CAMERAS, NOOP_ACTION
from tests.substrates.libero.data import DATA, TASKS, needs_package
from tests.substrates.libero.reference import Reference, assert_same
from tests.worlds.states import differing, every_array, random_actions, random_poses

pytestmark = needs_package

SEED = 195
STEPS = int(os.environ.get("LIBERO_MAX_TEST_STEPS", "8"))
"""Random actions played on each of the forty tasks; 200 for the long version of the comparison."""


def make_world(
    installation: Installation, suite: str, index: int, semantics: Semantics = "published"
) -> LiberoWorld:
    task = task_of(installation, suite, index)
    built = build(installation, task.bddl, SEED, rebuild=semantics == "corrected")
    return LiberoWorld(f"libero/{suite}/{index}", task.language, built, read_states(task.states), semantics)


@pytest.mark.parametrize(("suite", "index"), TASKS)
def test_states_observations_and_success_are_those_of_the_packages_own_step(
    installation: Installation, suite: str, index: int
) -> None:
    world = make_world(installation, suite, index)
    assert isinstance(world, World)
    reference = Reference(installation, task_of(installation, suite, index), SEED)
    init = index % len(world._states)
    world.reset(init)
    reference.start(world.initial_state(init))
    for field in ("body_pos", "body_quat", "geom_rgba", "site_rgba", "qpos0"):
        assert np.array_equal(getattr(world.model, field), getattr(reference.model, field)), field
    assert_same(world, reference, "start")
    for number, action in enumerate([(*NOOP_ACTION,)] * 2 + list(random_actions(index, STEPS))):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")
    assert_nothing_visible_is_left_out(world)
    reference.close()
    world.close()


def assert_nothing_visible_is_left_out(world: LiberoWorld) -> None:
    """Compare images with those of a renderer that draws everything, also of a moved stove and camera."""
    stoves = [name for name in world.entities if "stove" in name]
    camera = world.model.camera("agentview").id
    for moved in (False, True):
        for name in stoves if moved else ():
            world.place(name, world.position(name) + np.array([0.1, -0.15, 0.05]), (0.95, 0.1, 0.05, 0.2948))
        if moved:
            world.alter("cam_pos", camera, world.model.cam_pos[camera] + np.array([0.1, 0.2, -0.15]))
        images = world.observe(size=128)
        assert world._view is not None
        plain = Renderer(world.model, world._view, reflections=True)
        for name in CAMERAS:
            assert np.array_equal(images[f"{name}_image"], plain.render(name, 128)), (name, moved)
        plain.close()


@pytest.mark.parametrize(("suite", "index"), [("libero_spatial", 4), ("libero_object", 3), ("libero_10", 2)])
def test_equal_bits_last(installation: Installation, suite: str, index: int) -> None:
    world = make_world(installation, suite, index)
    reference = Reference(installation, task_of(installation, suite, index), SEED)
    world.reset(7)
    reference.start(world.initial_state(7))
    for number, action in enumerate(random_actions(5, 60)):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")


@pytest.mark.parametrize("settling", [0, 2])
def test_poses_have_the_bits_of_the_packages_own_step_with_use_delta_off(
    installation: Installation, settling: int
) -> None:
    world = make_world(installation, "libero_spatial", 4)
    reference = Reference(installation, task_of(installation, "libero_spatial", 4), SEED)
    world.reset(3)
    reference.start(world.initial_state(3))
    for _ in range(settling):
        reference.step(NOOP_ACTION)
        world.step(NOOP_ACTION)
    world.set_control("absolute")
    reference.env.robots[0].controller.use_delta = False
    for number, action in enumerate(random_poses(world.end_effector(), 1, 8)):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")
    world.reset(3)
    reference.env.robots[0].controller.use_delta = True
    reference.env.reset()
    reference.start(world.initial_state(3))
    reference.step(NOOP_ACTION)
    world.step(NOOP_ACTION)
    assert_same(world, reference, "the first movement of the next episode")


@pytest.mark.parametrize(("suite", "index"), [("libero_spatial", 0), ("libero_object", 1)])
def test_images_are_those_of_the_packages_own_renderer(
    installation: Installation, suite: str, index: int
) -> None:
    world = make_world(installation, suite, index)
    reference = Reference(installation, task_of(installation, suite, index), SEED, images=True)
    world.reset(2)
    reference.start(world.initial_state(2))
    assert_same(world, reference, "start")
    for number, action in enumerate(random_actions(1, 4)):
        reference.step(action)
        world.step(action)
        assert_same(world, reference, f"step {number}")
    reference.close()
    world.close()


@pytest.mark.parametrize("suite_and_index", [("libero_goal", 7), ("libero_10", 2)])
def test_the_burners_glow_is_seen_when_the_package_shows_it(
    installation: Installation, suite_and_index: tuple[str, int]
) -> None:
    """The package colours the burner after it has taken the pictures of the step."""
    world = make_world(installation, *suite_and_index)
    reference = Reference(installation, task_of(installation, *suite_and_index), SEED, images=True)
    world.reset(0)
    reference.start(world.initial_state(0))
    knob = world.model.joint("flat_stove_1_button")
    for data in (world.data, reference.data):
        data.qvel[knob.dofadr] = 20.0
    mujoco.mj_forward(world.model, world.data)
    for number in range(3):
        reference.step(NOOP_ACTION)
        world.step(NOOP_ACTION)
        assert_same(world, reference, f"step {number}")
    assert (world.data.qpos[knob.qposadr] > 0.5).all()


@pytest.mark.parametrize("action", ["move", "camera"])
def test_a_look_after_an_event_and_all_later_ones_are_those_of_the_authors(
    installation: Installation, action: str
) -> None:
    world = make_world(installation, "libero_spatial", 2)
    reference = Reference(installation, task_of(installation, "libero_spatial", 2), SEED, images=True)
    world.reset(1)
    reference.start(world.initial_state(1))
    actions = random_actions(8, 6)
    for step in actions[:3]:
        reference.step(step)
        world.step(step)
    if action == "move":
        target = world.position("akita_black_bowl_1") + np.array([0.0, 0.06, 0.0])
        world.place("akita_black_bowl_1", target)
        reference.data.joint("akita_black_bowl_1_joint0").qpos[:3] = target
        reference.data.joint("akita_black_bowl_1_joint0").qvel[:] = 0.0
    else:
        camera = world.model.camera("agentview").id
        world.alter("cam_pos", camera, world.model.cam_pos[camera] + np.array([0.06, 0.0, 0.02]))
        reference.model.cam_pos[camera] = world.model.cam_pos[camera]
    reference.refresh()
    seen = world.observe(size=128)
    for key, value in seen.items():
        assert np.array_equal(value, reference.observation[key]), key
    for number, step in enumerate(actions[3:]):
        reference.step(step)
        world.step(step)
        assert_same(world, reference, f"step {number}")


def test_observations_are_as_old_with_a_setup_as_without(installation: Installation) -> None:
    """The authors' runner looks once after the setup, even if there is none."""
    ages = []
    for names in ((), ("cookies_1",), ("cookies_1", "akita_black_bowl_2")):
        world = make_world(installation, "libero_spatial", 2)
        reference = Reference(installation, task_of(installation, "libero_spatial", 2), SEED)
        world.reset(1)
        for name in names:
            world.park(name, (-2.0, 0.0, -5.0))
        reference.start(world.initial_state(1), names, (-2.0, 0.0, -5.0))
        for number, step in enumerate(random_actions(8, 3)):
            reference.step(step)
            world.step(step)
            assert_same(world, reference, f"{len(names)} objects taken out, step {number}")
        ages.append(world._sample_at)
    assert ages == [21, 21, 21]


def test_corrected_worlds_look_once_and_their_fixtures_stand_where_an_evaluation_finds_them(
    installation: Installation,
) -> None:
    """Where a task begins with an open drawer, the authors' shorter reset leaves the fixtures elsewhere."""
    corrected = make_world(installation, "libero_spatial", 4, "corrected")
    published = make_world(installation, "libero_spatial", 4)
    cabinet = [world.position("wooden_cabinet_1") for world in (corrected, published)]
    assert 0.005 < np.linalg.norm(cabinet[0] - cabinet[1]) < 0.02
    for world in (corrected, published):
        world.step(NOOP_ACTION)
    assert (corrected._sample_at, published._sample_at) == (24, 21)


def test_a_goal_state_is_a_success(installation: Installation) -> None:
    for suite, index in [("libero_object", 0), ("libero_goal", 4)]:
        world = make_world(installation, suite, index)
        name = task_of(installation, suite, index).name
        paths = sorted((DATA / "goal_states" / suite).glob(f"{name}*.npy"))
        assert paths, name
        state = np.load(paths[0]).ravel()
        world.reset(0)
        assert not world.succeeded()
        world.data.qpos[:] = state[1 : 1 + world.model.nq]
        mujoco.mj_forward(world.model, world.data)
        assert world.succeeded()


@pytest.mark.parametrize("step", [0, 1, 6])
def test_a_restored_world_continues_with_the_same_bits(installation: Installation, step: int) -> None:
    world = make_world(installation, "libero_10", 2)
    world.reset(3)
    actions = random_actions(4, 16)
    for action in actions[:step]:
        world.step(action)
    state, futures = world.snapshot(), []
    for _ in range(2):
        digests = [world.digest()]
        for action in actions[step:]:
            world.step(action)
            seen = world.observe((), 1)
            digests.append(world.digest() + b"".join(value.tobytes() for value in seen.values()))
        futures.append(digests)
        world.reset(5)
        world.step(actions[0])
        world.restore(state)
    assert futures[0] == futures[1]


@pytest.mark.parametrize("semantics", ["published", "corrected"])
def test_no_trace_of_an_event_survives_a_reset(installation: Installation, semantics: Semantics) -> None:
    world = make_world(installation, "libero_spatial", 0, semantics)
    world.reset(0)
    before, digest = every_array(world.model), world.digest()
    world.park("cookies_1", (-2.0, 0.0, -5.0))
    world.step(NOOP_ACTION)
    world.alter("light_diffuse", slice(None), 0.1)
    world.place("wooden_cabinet_1", world.position("wooden_cabinet_1") + 0.01)
    world.step(NOOP_ACTION)
    world.reset(0)
    assert differing(before, every_array(world.model)) == []
    assert world.digest() == digest


def test_what_is_taken_out_is_shot_away_as_published_and_stays_in_the_corrected_form(
    installation: Installation,
) -> None:
    poses = {}
    for semantics in ("published", "corrected"):
        world = make_world(installation, "libero_object", 0, semantics)
        world.reset(0)
        start = world.pose("milk_1")
        world.park("milk_1", (-2.0, 0.0, -5.0))
        for _ in range(30):
            world.step(NOOP_ACTION)
        away = world.pose("milk_1")
        assert world.parked == ("milk_1",)
        assert np.array_equal(world.parked_pose("milk_1")[0], start[0])
        world.unpark("milk_1", (0.2, 0.2, start[0][2]))
        poses[semantics] = away, world.pose("milk_1")[1], start[1]
        assert not world.parked
    away, back, upright = poses["corrected"]
    assert np.array_equal(away[0], (-2.0, 0.0, -5.0))
    assert np.array_equal(back, upright)
    away, back, upright = poses["published"]
    assert away[0][2] > 10.0
    assert np.array_equal(back, away[1])
    assert not np.allclose(back, upright, atol=1e-3)


def test_derived_data_belong_to_the_end_of_the_step(installation: Installation) -> None:
    world = make_world(installation, "libero_object", 1)
    for action in random_actions(0, 3):
        world.step(action)
    fresh = copy(world.data)
    mujoco.mj_forward(world.model, fresh)
    for field in ("xpos", "site_xpos", "cam_xpos", "qfrc_bias"):
        assert np.array_equal(getattr(world.data, field), getattr(fresh, field)), field


def test_other_goals_are_decided_by_the_packages_predicates(installation: Installation) -> None:
    world = make_world(installation, "libero_spatial", 8)
    world.assign(goal=(("on", "cookies_1", "main_table_box_region"),))
    with pytest.raises(EntityError, match="Did you mean 'cookies_1'"):
        world.assign(goal=(("on", "cookie_1", "plate_1"),))
    with pytest.raises(SubstrateError, match="predicate='onto'"):
        world.assign(goal=(("onto", "cookies_1", "plate_1"),))
    assert world.goal == (Fact("on", "cookies_1", "main_table_box_region"),)
    world.reset(0)
    assert world.goal == (Fact("on", "akita_black_bowl_1", "plate_1"),)


def test_facts_and_joints_are_the_packages_own(installation: Installation) -> None:
    world = make_world(installation, "libero_spatial", 4)
    assert isinstance(world, PrivilegedWorld)
    (joint,) = world.joints("wooden_cabinet_1_top_region")
    assert joint in world.joints("wooden_cabinet_1")
    for place in ("flat_stove_1_cook_region", "main_table_box_region", "plate_1", "main_table"):
        assert world.joints(place) == ()
    with pytest.raises(EntityError, match="Did you mean 'flat_stove_1_cook_region'"):
        world.joints("flat_stove_1_cooking_region")
    drawer = Fact("open", "wooden_cabinet_1_top_region")
    assert world.holds(drawer)
    world.data.joint(joint).qpos[0] = 0.0
    assert not world.holds(drawer)
    assert not world.holds(Fact("on", "akita_black_bowl_1", "plate_1"))


def test_there_are_fifty_initial_states(installation: Installation) -> None:
    world = make_world(installation, "libero_object", 9)
    world.reset(49)
    with pytest.raises(SubstrateError, match="0 to 49, but 50"):
        world.reset(50)


def test_states_of_another_task_are_refused(installation: Installation) -> None:
    task = task_of(installation, "libero_object", 0)
    built = build(installation, task.bddl, SEED)
    with pytest.raises(SubstrateError, match=r"92 numbers, .* 110"):
        LiberoWorld("libero/x", "", built, read_states(task_of(installation, "libero_spatial", 0).states))


def test_a_scene_that_cannot_be_built_says_so(installation: Installation, tmp_path: Path) -> None:
    with pytest.raises(SubstrateError, match=r"missing\.bddl"):
        build(installation, tmp_path / "missing.bddl", 0)


def test_the_global_generator_is_left_alone(installation: Installation) -> None:
    np.random.seed(3)  # noqa: NPY002
    expected = np.random.random(4)  # noqa: NPY002
    np.random.seed(3)  # noqa: NPY002
    make_world(installation, "libero_spatial", 1)
    assert np.array_equal(np.random.random(4), expected)  # noqa: NPY002


def test_memory_stays_flat_over_resets(installation: Installation) -> None:
    world = make_world(installation, "libero_spatial", 3)
    world.reset(0)
    world.step(NOOP_ACTION)

    def resident_mb() -> float:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    for number in range(20):
        world.reset(number % 50)
    before = resident_mb()
    for number in range(200):
        world.reset(number % 50)
        world.step(NOOP_ACTION)
    assert resident_mb() - before < 20
