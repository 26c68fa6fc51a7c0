import json
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case, Event, parse_case
from pytest_libero_max.benchmark.manifests import Manifest, parse_manifest
from pytest_libero_max.changes import Change, MoveObject, ShiftCamera, change_from_dict
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.change_strategies import alters
from pytest_libero_max.pairing.runner import inject
from pytest_libero_max.policies.contract import (
    Episode,
    Policy,
    PolicySpec,
    Query,
    RemembersPolicy,
    query_seed,
)
from pytest_libero_max.substrates.embedded.catalogue.lookup import variation_of
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.substrates.variation import Variation
from pytest_libero_max.worlds.contract import Entity, Observation

ENTITIES = {
    name: Entity(name, "thing", "object", f"{name}_main", support="main_table")
    for name in ("mug_1", "plate_1", "jar_1")
} | {"main_table": Entity("main_table", "table", "surface", "table")}
EPISODE = Episode("libero_spatial", 0, "do it", 195, 220)


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def query(step: int, index: int = 0) -> Query:
    return Query(index, step, "do it", query_seed(195, index))


def observation(x: float) -> Observation:
    return {"robot0_eef_pos": np.array([x, 0.0, 0.0])}


@given(strategies.strengths())
def test_strengths_stay_within_their_range(strength: float) -> None:
    assert 0.0 <= strength <= 1.0


@given(strategies.changes(ENTITIES))
def test_changes_are_changes_that_a_manifest_can_hold(change: Change) -> None:
    assert isinstance(change, Change)
    assert change_from_dict(change.to_dict()) == change


@given(st.data())
def test_changes_can_be_narrowed_to_operations(data: st.DataObject) -> None:
    change = data.draw(strategies.changes(ENTITIES, operations=["move_object"]))
    assert change.operation == "move_object"
    assert isinstance(change, MoveObject)
    assert change.object in ENTITIES
    assert change.object != "main_table"


def test_an_operation_that_needs_a_setup_is_refused() -> None:
    with pytest.raises(OptionError, match="'insert_obstacle' cannot be applied"):
        strategies.changes(ENTITIES, operations=["insert_obstacle"])


@given(strategies.events(ENTITIES))
def test_events_take_out_exactly_what_they_bring_back(event: Event) -> None:
    removed = [step["object"] for step in event.setup]
    change = change_from_dict(event.change)
    if event.name in ("distractor_burst", "obstacle_insertion"):
        assert change.factors == {f"pose:{name}" for name in removed}
        assert event.entity not in removed
    else:
        assert removed == []


@given(strategies.cases(ENTITIES))
def test_cases_stand_for_unmodified_tasks(case: Case) -> None:
    assert case.source == "libero"
    assert case.record["scenario"]["change"] == case.event.change


@given(strategies.varied_cases())
@settings(deadline=None)  # the first one makes the catalogues
def test_varied_cases_name_a_variation_of_the_catalogue(case: Case) -> None:
    variation = variation_of(case)
    assert (variation.source, variation.category) == (case.source, case.source_category)
    assert parse_case(json.loads(json.dumps(case.record))) == case


@given(strategies.source_variations("pro"))
@settings(max_examples=20, deadline=None)
def test_source_variations_are_of_the_source(variation: Variation) -> None:
    assert variation.source == "pro"


@given(strategies.manifests(ENTITIES))
@settings(max_examples=30)
def test_manifests_pass_the_check_of_manifests(manifest: Manifest) -> None:
    assert parse_manifest(json.loads(manifest.to_json())) == manifest


@given(strategies.action_sequences(max_size=4))
def test_actions_have_seven_finite_components(actions: list[tuple[float, ...]]) -> None:
    array = np.array(actions)
    assert array.shape == (len(actions), 7)
    assert np.abs(array).max() <= 1.5


@given(strategies.scripted_policies(), st.integers(0, 100), st.floats(-1, 1))
def test_scripted_policies_keep_the_contract_and_repeat_themselves(
    policy: strategies.ScriptedPolicy, step: int, x: float
) -> None:
    assert isinstance(policy, Policy)
    policy.reset(EPISODE)
    first = policy.predict(observation(x), query(step))
    assert policy.spec.query_interval <= len(first) <= policy.spec.horizon
    assert first.shape[1] == 7
    assert np.abs(first).max() <= 1.0
    policy.reset(EPISODE)
    assert np.array_equal(first, policy.predict(observation(x), query(step)))


@given(strategies.scripted_policies(memory=True))
def test_a_remembering_policy_continues_from_its_snapshot(policy: strategies.ScriptedPolicy) -> None:
    assert isinstance(policy, RemembersPolicy)
    policy.reset(EPISODE)
    policy.predict(observation(0.1), query(0))
    memory = policy.snapshot()
    second = policy.predict(observation(0.2), query(1, 1))
    policy.predict(observation(0.3), query(2, 2))
    policy.restore(memory)
    assert np.array_equal(second, policy.predict(observation(0.2), query(1, 1)))


def test_memory_reaches_the_actions() -> None:
    spec = PolicySpec("scripted", 1, 1, ())
    policy = strategies.RememberingPolicy(spec, [[0.0] * 7], 1)
    policy.reset(EPISODE)
    policy.predict(observation(0.1), query(0))
    remembering = policy.predict(observation(0.2), query(1, 1))
    policy.reset(EPISODE)
    assert not np.array_equal(remembering, policy.predict(observation(0.2), query(1, 1)))


def test_only_this_module_needs_hypothesis() -> None:
    code = (
        "import sys, pytest_libero_max.changes, pytest_libero_max.events.registry\n"
        "sys.exit('hypothesis' in sys.modules or 'mujoco' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@given(strategies.cases())
@settings(max_examples=200, deadline=None)
def test_no_event_is_drawn_that_changes_nothing(world: TinyWorld, case: Case) -> None:
    world.reset(0)
    for change in case.event.setup:
        change_from_dict(change).apply(world)
    inject(case, world)  # refuses what leaves the world as it was


def test_a_camera_that_stays_is_no_change() -> None:
    zero = ShiftCamera("agentview", (0.0, 0.0, 1e-300), 0.0, 0.0)
    assert not alters(zero.to_dict())
    assert alters(ShiftCamera("agentview", (0.0, 0.0, 0.01), 0.0, 0.0).to_dict())
