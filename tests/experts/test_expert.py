"""The two experts: what they can do, and in what they differ."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.events.registry import resolve_event
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import PairSettings, inject, play_pair, play_prefix
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.policies.check import copy_memory, remembers, restore_memory
from pytest_libero_max.policies.contract import Policy, Query
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import pro_suite
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.variation import variation_metadata
from pytest_libero_max.tasks.contents import task_metadata
from pytest_libero_max.tasks.libero_tasks import SUITES

QUERY = Query(index=0, step=0, instruction="", seed=0)
SAMPLE = {"libero_spatial": (0, 4, 9), "libero_object": (0, 7), "libero_10": (0, 2, 3, 4, 5, 8, 9)}
"""Tasks that ask for different skills; those of ``libero_goal`` all do."""
WHOLE = "LIBERO_MAX_TEST_EXAMPLES" in os.environ
TASKS = [(suite, task) for suite in SUITES for task in (range(10) if WHOLE else SAMPLE.get(suite, range(10)))]


@pytest.fixture(scope="module")
def substrate() -> Iterator[EmbeddedSubstrate]:
    substrate = EmbeddedSubstrate()
    yield substrate
    substrate.close()


def blind(name: str, horizon: int | None = None, query_interval: int | None = None) -> Policy:
    policy = load_policy(name, horizon=horizon, query_interval=query_interval)
    policy.spec = replace(policy.spec, cameras=())
    return policy


def make_case(suite: str, task: int, init: int, event: str = "illumination_switch", variant: int = 0) -> Case:
    metadata, identity = task_metadata(suite, task), Identity("libero", suite, task, init)
    return parse_case(case_record(identity, resolve_event(event, variant, metadata, identity), metadata.name))


@pytest.mark.parametrize(("suite", "task"), TASKS)
def test_expert_solves_every_task(suite: str, task: int, substrate: EmbeddedSubstrate) -> None:
    # A different initial state for each task: together they sample all ten.
    case = make_case(suite, task, init=task)
    rollout = Rollout.start(Stage(case, substrate.world(case), blind("expert")))
    assert rollout.advance_to_end().success


RELOCATIONS = [
    ("libero_spatial", 0, "target_relocation", 0),
    ("libero_object", 7, "receptacle_relocation", 1),
    ("libero_spatial", 1, "receptacle_relocation", 0),
    ("libero_object", 9, "target_relocation", 1),
]


@pytest.mark.parametrize(("suite", "task", "event", "variant"), RELOCATIONS if WHOLE else RELOCATIONS[:2])
def test_after_a_relocation_only_the_expert_that_looks_again_succeeds(
    suite: str, task: int, event: str, variant: int, substrate: EmbeddedSubstrate
) -> None:
    case = make_case(suite, task, 0, event, variant)
    outcomes = {name: play(case, substrate, name) for name in ("expert", "stale_expert")}
    assert outcomes["expert"].base_success
    assert outcomes["stale_expert"].base_success
    assert outcomes["expert"].dynamic_success
    assert not outcomes["stale_expert"].dynamic_success


@pytest.mark.parametrize("name", ["stale_expert", "expert"] if WHOLE else ["stale_expert"])
def test_replayed_and_forked_prefix_lead_to_the_same_record(name: str, substrate: EmbeddedSubstrate) -> None:
    case = make_case("libero_object", 2, 0, "target_relocation", 1)
    records = [play(case, substrate, name, PairSettings(mode)) for mode in ("fork", "replay")]
    assert records[0].identity() == records[1].identity()


VARIATIONS = [
    ("object", "libero_goal", 3),  # a drawer in a cabinet of another name
    ("task", "libero_goal", 9),  # something that does not go down all the way
    ("initial_pose_position_angle", "libero_10", 9),  # a mug with its handle askew
]


@pytest.mark.parametrize(("category", "suite", "task"), VARIATIONS)
def test_expert_solves_what_was_varied(
    category: str, suite: str, task: int, substrate: EmbeddedSubstrate
) -> None:
    variation = pro_suite(category, suite)[task]
    identity = Identity("pro", suite, task, 0, category)
    event = resolve_event("illumination_switch", 0, variation_metadata(variation), identity)
    record = case_record(identity, event, variation.name)
    case = parse_case({**record, "substrate_category": f"LIBERO-PRO/{category}"})
    rollout = Rollout.start(Stage(case, substrate.varied_world(variation), blind("expert")))
    assert rollout.advance_to_end().success


def test_expert_copes_with_another_query_interval(substrate: EmbeddedSubstrate) -> None:
    case = make_case("libero_spatial", 0, 1)
    for horizon, interval in ((1, 1), (10, 10)):
        policy = blind("expert", horizon=horizon, query_interval=interval)
        assert Rollout.start(Stage(case, substrate.world(case), policy)).advance_to_end().success


def test_actions_leave_the_hand_where_it_was_foreseen(substrate: EmbeddedSubstrate) -> None:
    """Executing a chunk blindly ends where replanning at every step ends, to a few millimetres."""
    ends = []
    for interval in (1, 10):
        case = make_case("libero_spatial", 6, 0)
        world, policy = substrate.world(case), blind("expert", query_interval=interval)
        rollout = Rollout.start(Stage(case, world, policy))
        for _ in range(policy.spec.horizon):
            rollout.advance()
        ends.append(world.end_effector())
    # Chunk after chunk it adds up, to 8 mm after 20 steps and 15 mm after 40.
    assert np.linalg.norm(ends[0] - ends[1]) < 0.005


def test_only_the_expert_that_looks_again_answers_to_an_event(substrate: EmbeddedSubstrate) -> None:
    case = make_case("libero_object", 0, 0, "target_relocation", 1)
    world, answers_alike = substrate.world(case), {}
    for name in ("expert", "stale_expert"):
        policy = blind(name)
        assert play_prefix(case, world, policy) is not None
        memory = copy_memory(policy)
        before = policy.predict({}, QUERY)
        inject(case, world)
        if remembers(policy):
            restore_memory(policy, memory)
        answers_alike[name] = np.array_equal(policy.predict({}, QUERY), before)
    assert answers_alike == {"expert": False, "stale_expert": True}


def play(
    case: Case, substrate: EmbeddedSubstrate, name: str, settings: PairSettings | None = None
) -> PairRecord:
    return play_pair(case, substrate.world(case), blind(name), settings)
