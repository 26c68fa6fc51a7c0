"""The policy that sees: what it finds in images, and that it acts on nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.lab.servo import sight
from pytest_libero_max.lab.servo.servo import ServoPolicy, covers, read_hand, understand
from pytest_libero_max.lab.servo.servo_scenes import BOWL, BOWL_PLACES, CAMERA, IMAGE_SIZE, SCENES, SHAPES
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.contract import Episode, Query
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.tasks.libero_tasks import tasks
from pytest_libero_max.worlds.contract import Observation

SPATIAL = "pick up the black bowl on the cookie box and place it on the plate"


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


@pytest.fixture(scope="module")
def observation(substrate: EmbeddedSubstrate) -> Observation:
    world = substrate.world(make_case("libero_spatial", 3, 7))
    world.reset(7)
    return world.observe((CAMERA,), IMAGE_SIZE)


def make_case(suite: str, task: int, init: int) -> Case:
    metadata, identity = task_metadata(suite, task), Identity("libero", suite, task, init)
    scenario = resolve_event("illumination_switch", 0, metadata, identity)
    return parse_case(case_record(identity, scenario, metadata.name))


def ask(policy: ServoPolicy, observation: Observation, instruction: str = SPATIAL) -> bytes:
    return policy.predict(observation, Query(0, 0, instruction, 1)).tobytes()


def begin() -> ServoPolicy:
    policy = ServoPolicy()
    policy.reset(Episode("libero_spatial", 3, SPATIAL, 195, 220, world=None))
    return policy


# Initial states beyond those from which the colours were learned (0 to 4).
@pytest.mark.parametrize(("suite", "task", "init"), [("libero_object", 3, 8), ("libero_spatial", 3, 7)])
def test_it_solves_tasks_without_the_world(
    suite: str, task: int, init: int, substrate: EmbeddedSubstrate
) -> None:
    policy = load_policy("servo")
    assert not policy.spec.privileged
    rollout = Rollout.start(
        Stage(make_case(suite, task, init), substrate.world(make_case(suite, task, init)), policy)
    )
    assert rollout.advance_to_end().success


def test_the_same_observation_and_memory_give_the_same_actions(observation: Observation) -> None:
    first, second = begin(), begin()
    assert ask(first, observation) == ask(second, observation)
    memory = first.snapshot()
    later = {**observation, "robot0_eef_pos": np.asarray(observation["robot0_eef_pos"]) + 0.02}
    answer = ask(first, later)
    ask(first, observation)
    first.restore(memory)
    assert ask(first, later) == answer


@pytest.mark.parametrize(
    "change",
    [{f"{CAMERA}_image": np.zeros((IMAGE_SIZE, IMAGE_SIZE, 3), np.uint8)}, {"robot0_eef_pos": np.ones(3)}],
)
def test_its_actions_depend_on_image_and_hand(change: Observation, observation: Observation) -> None:
    assert ask(begin(), {**observation, **change}) != ask(begin(), observation)


def test_an_object_is_found_within_a_centimetre(
    substrate: EmbeddedSubstrate, observation: Observation
) -> None:
    world = substrate.world(make_case("libero_spatial", 3, 7))
    world.reset(7)
    scene, image = SCENES["libero_spatial"], observation[f"{CAMERA}_image"][::-1]
    bowl = understand(scene, SPATIAL)
    for category, area, entity in (
        (bowl.category, bowl.area, "akita_black_bowl_1"),
        ("plate", scene.destination_area, "plate_1"),
    ):
        seen = sight.find(sight.chances(image, category), scene.camera, SHAPES[category], area)
        assert np.linalg.norm((seen.position - world.position(entity))[:2]) < 0.01
        assert seen.score > 0.5


@pytest.mark.parametrize("away", [(0.0, -0.7), (0.0, 0.7), (0.6, 0.0), (-6.0, 0.0), (0.0, 2.0)])
def test_what_is_outside_the_image_scores_least(away: tuple[float, float]) -> None:
    scene, shape = SCENES["libero_spatial"], SHAPES["plate"]
    position = np.array([*away, scene.destination_area.height])
    pixels = scene.camera.project(shape.points(position))
    assert ((pixels < 0) | (pixels >= IMAGE_SIZE)).any(axis=1).all()
    likely = np.ones((IMAGE_SIZE, IMAGE_SIZE), dtype=np.float32)
    assert sight.score(likely, scene.camera, shape, position) == -1.0


def test_every_instruction_of_its_suites_is_understood() -> None:
    for task in tasks("libero_object"):
        assert understand(SCENES["libero_object"], task.language).category == task.goal[0].subject[:-2]
    spatial = [understand(SCENES["libero_spatial"], task.language) for task in tasks("libero_spatial")]
    assert {wish.category for wish in spatial} == {BOWL}
    assert len({wish.area for wish in spatial}) == len(BOWL_PLACES) == 10


def test_colours_were_learned_of_everything_that_has_a_shape() -> None:
    assert set(sight.colour_table()) == set(SHAPES)
    likelihoods = [value for table in sight.colour_table().values() for value in table.values()]
    assert 0 < min(likelihoods) <= max(likelihoods) <= 100


def test_the_hand_covers_what_is_behind_it(observation: Observation) -> None:
    scene, hand = SCENES["libero_spatial"], read_hand(observation)
    spot = np.array([0.0, 0.1, 0.9])
    above = replace(hand, position=spot + np.array([0.05, 0.0, 0.06]))
    aside = replace(hand, position=spot + np.array([0.0, -0.3, 0.06]))
    assert covers(scene, above, SHAPES[BOWL], spot)
    assert not covers(scene, aside, SHAPES[BOWL], spot)
