"""Meta-World's tasks as worlds: exact copies, the package's own numbers, events, the scripted policies."""

from __future__ import annotations

import re
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import pytest_libero_max
from pytest_libero_max.benchmark import tracks
from pytest_libero_max.errors import ActionError, ManifestError, SubstrateError
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.lab.metaworld import robot
from pytest_libero_max.lab.metaworld.robot import MT50
from pytest_libero_max.lab.metaworld.tasks import all_tasks, contents
from pytest_libero_max.makers.construction.verification import verify
from pytest_libero_max.policies.clients.messages import Reply, Request
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.policies.profile import load_profile
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import SUBSTRATES, open_substrate
from pytest_libero_max.worlds.robot import ROBOTS

FOLDER = Path(robot.__file__).parent
INDEX = {task.name: index for index, task in enumerate(all_tasks())}
HERE = not robot.lacking_packages()
needs_package = pytest.mark.skipif(not HERE, reason=robot.lacking_packages() or "it is here")

SHIFT_M = np.array((0.03, -0.02, 0.0))
MOVABLE = ("push-v3", "button-press-v3", "peg-insert-side-v3", "window-open-v3", "reach-v3", "basketball-v3")


def test_the_table_has_fifty_tasks_with_their_instructions() -> None:
    assert len(all_tasks()) == MT50.tasks == len(INDEX)
    assert all_tasks()[INDEX["drawer-open-v3"]].instruction == "Open a drawer"
    for task in all_tasks():
        assert {task.target, task.receptacle} - {None} <= set(task.things)


def test_every_task_hosts_what_is_only_seen_and_says_why_it_hosts_nothing_else() -> None:
    hosted = dict.fromkeys(BENCHMARK_EVENTS, 0)
    for index in range(MT50.tasks):
        task = contents(MT50.name, index)
        for event in BENCHMARK_EVENTS:
            hosted[event] += eligible(event, task)
            assert eligible(event, task) or task.impossible[event].endswith(".")
    assert hosted == {
        **dict.fromkeys(BENCHMARK_EVENTS[:4], 50),
        "target_relocation": 28,
        "receptacle_relocation": 14,
        "distractor_burst": 49,
        "obstacle_insertion": 49,
    }


def test_an_event_that_a_task_cannot_host_is_refused_with_its_reason() -> None:
    with pytest.raises(ManifestError, match="in the peg"):
        make_case("target_relocation", MT50.name, INDEX["disassemble-v3"])
    with pytest.raises(ManifestError, match="10 x 5 cm"):
        make_case("target_relocation", MT50.name, INDEX["push-wall-v3"])


def test_without_the_package_the_command_that_installs_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot, "find_spec", lambda name: None if name == "metaworld" else find_spec(name))
    case = make_case("camera_shift", MT50.name, 0)
    kind = SUBSTRATES["metaworld"]
    (reason,) = kind.lacking(SubstrateOptions(), [case]).values()
    assert robot.INSTALL in reason
    with pytest.raises(SubstrateError, match="pip install --no-deps metaworld"):
        open_substrate("metaworld").world(case)


@needs_package
@pytest.mark.parametrize("name", ["assembly-v3", "button-press-v3", "stick-push-v3", "door-lock-v3"])
def test_a_fork_a_replay_and_the_package_itself_lead_to_the_same_bits(name: str) -> None:
    from tests.lab.metaworld.all_tasks import differences

    assert differences(all_tasks()[INDEX[name]], init=3, steps=45) == []


@needs_package
@pytest.mark.parametrize("left_out", ["mjSTATE_WARMSTART", "mjSTATE_MOCAP_POS"])
def test_a_snapshot_without_warm_start_or_mocap_body_is_found(
    monkeypatch: pytest.MonkeyPatch, left_out: str
) -> None:
    import mujoco

    from pytest_libero_max.worlds import mujoco_world
    from tests.lab.metaworld.all_tasks import differences

    state = mujoco.mjtState
    less = int(state.mjSTATE_INTEGRATION) & ~int(getattr(state, left_out))
    monkeypatch.setattr(mujoco_world, "_STATE", less)
    assert "fork" in differences(all_tasks()[INDEX["push-v3"]], steps=45)


@needs_package
@pytest.mark.parametrize("name", MOVABLE)
def test_what_belongs_to_a_thing_comes_along_and_goes_back_bit_for_bit(name: str) -> None:
    from pytest_libero_max.lab.metaworld.world import MetaworldWorld

    task = all_tasks()[INDEX[name]]
    world, goal = MetaworldWorld(task), task.receptacle or task.target
    for _ in range(5):
        world.step(world.robot.noop)
    before, seen = world.snapshot(), world.task_observation()
    where, room = world.position(goal), task.things[goal].room
    assert room is not None
    inwards = np.sign((room[0] + room[2]) / 2 - where[0])  # the task shows no goal beyond its bounds
    shift = SHIFT_M * (inwards, 0.0, 0.0)
    world.place(goal, where + shift)
    assert world.task_observation()[-3:] == pytest.approx(seen[-3:] + shift, abs=1e-9)
    world.place(goal, where)
    assert world.snapshot().differing(before) == ()
    assert world.task_observation().tobytes() == seen.tobytes()
    world.close()


@needs_package
def test_a_relocated_target_is_solved_where_it_is_now() -> None:
    """The task itself judges the new place: the policy presses the button where the event has put it."""
    from pytest_libero_max.lab.metaworld.world import MetaworldWorld
    from tests.lab.metaworld.all_tasks import scripted

    task = all_tasks()[INDEX["button-press-v3"]]
    world, act = MetaworldWorld(task), scripted(task.name)
    world.place("button_box", world.position("button_box") + 2.0 * SHIFT_M * (1, 0, 0))
    for _ in range(150):
        world.step(act(world.task_observation()))
        if world.succeeded():
            break
    assert world.succeeded()
    assert world.end_effector()[0] == pytest.approx(world.position("button_box")[0], abs=0.02)
    world.close()


@needs_package
def test_spare_objects_are_in_the_scenes_of_insertions_alone() -> None:
    from pytest_libero_max.lab.metaworld.substrate import MetaworldSubstrate

    opened = MetaworldSubstrate()
    plain = opened.world(make_case("camera_shift", MT50.name, INDEX["push-v3"]))
    burst = opened.world(make_case("distractor_burst", MT50.name, INDEX["push-v3"]))
    obstacle = opened.world(make_case("obstacle_insertion", MT50.name, INDEX["push-v3"], variant=1))
    spares = [
        sorted(name for name in world.entities if name.startswith("spare")) for world in (plain, obstacle)
    ]
    assert spares == [[], ["spare_2"]]
    assert len({name for name in burst.entities if name.startswith("spare")}) == 5
    assert len({plain.scene, burst.scene, obstacle.scene}) == 3
    assert plain.model.nq == 16
    burst.reset(4)
    for name in (name for name in burst.entities if name.startswith("spare")):
        upright = burst.pose(name)[1]
        assert upright == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=0.01), "it rests where it was put"
    opened.close()


@needs_package
def test_the_world_speaks_of_its_own_robot() -> None:
    from pytest_libero_max.lab.metaworld.world import MetaworldWorld

    world = MetaworldWorld(all_tasks()[INDEX["pick-place-v3"]])
    assert world.robot is ROBOTS["SawyerXYZ"]
    assert (world.robot.components, world.robot.control_hz) == (4, 80)
    observation = world.observe(())
    assert {key: len(value) for key, value in observation.items()} == dict(world.robot.state)
    assert observation["agent_pos"].tolist() == world.task_observation()[:4].tolist()
    with pytest.raises(ActionError):
        world.step(np.zeros(7))
    with pytest.raises(SubstrateError, match="movements"):
        world.set_control("absolute")
    for init in (-1, MT50.states):
        with pytest.raises(SubstrateError, match=str(init)):
            world.reset(init)
    world.close()


@needs_package
def test_no_draw_comes_from_a_global_generator() -> None:
    from pytest_libero_max.lab.metaworld.world import MetaworldWorld

    task, starts = all_tasks()[INDEX["push-v3"]], []
    for seed in (1, 2):
        np.random.seed(seed)  # noqa: NPY002 - it must not matter
        world = MetaworldWorld(task)
        world.reset(7)
        starts.append(world.digest())
        world.close()
    assert starts[0] == starts[1]


@needs_package
def test_the_profile_asks_as_lerobot_shows_the_tasks() -> None:
    from pytest_libero_max.lab.metaworld.world import MetaworldWorld

    world = MetaworldWorld(all_tasks()[INDEX["push-v3"]])
    profile = load_profile(str(FOLDER / "smolvla.toml"))
    request = Request(profile)
    observation = world.observe(request.cameras, 480)
    built = request.build(observation, Query(0, 0, "Push it", 1), Episode(MT50.name, 38, "", 1, 500))
    image = built["observation"]["observation.image"]
    assert image.shape == (480, 480, 3)
    assert np.array_equal(image, observation["corner2_image"][::-1])
    assert built["observation"]["observation.state"].tolist() == pytest.approx(world.task_observation()[:4])
    assert Reply(profile).read({"actions": np.zeros((50, 4)).tolist()}, 4, 50).shape == (50, 4)
    world.close()


def test_no_other_file_of_the_package_names_it() -> None:
    package = Path(pytest_libero_max.__file__).parent
    names = re.compile(r"metaworld|meta-world|SawyerXYZ", re.IGNORECASE)
    files = (file for file in package.rglob("*.py") if FOLDER not in file.parents)
    assert [file for file in files if names.search(file.read_text(encoding="utf-8"))] == []


def test_the_frozen_tracks_are_balanced_and_follow_from_their_identities() -> None:
    folder = tracks.FOLDER / "metaworld"
    assert verify(folder)
    mt50 = tracks.load_track("metaworld/mt50")
    assert Counter(case.event.name for case in mt50) == dict.fromkeys(BENCHMARK_EVENTS, 64)
    assert len({case.task_index for case in mt50}) == MT50.tasks
    smoke = tracks.load_track("metaworld/smoke")
    assert Counter(case.event.name for case in smoke) == dict.fromkeys(BENCHMARK_EVENTS, 3)
    assert len({case.task_index for case in smoke}) == len(smoke) == 24
