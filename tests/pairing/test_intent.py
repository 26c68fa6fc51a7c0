"""Pairs that are scored by intent: another goal from the middle on, or a task that is cancelled."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.benchmark.manifests import Manifest, parse_manifest
from pytest_libero_max.benchmark.programs import parse_program
from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.errors import ChangeError, ManifestError
from pytest_libero_max.events.registry import check_cases
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.report.diagnosis import diagnose
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import NOOP_ACTION
from tests.pairing import actors
from tests.pairing.actors import Approaching, ShortCase, Solvable, make_case, policy_steps

BUDGET = 50
"""Policy steps of an episode here: a cancelled task is watched for long."""


@pytest.fixture(autouse=True)
def _longer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(actors, "BUDGET", BUDGET)


CANCEL = {
    "operation": "cancel_instruction",
    "instruction": "Leave it.",
    "stop_window_steps": 10,
    "eef_stop_threshold_m": 0.02,
    "eef_path_threshold_m": 0.04,
    "target_stop_threshold_m": 0.01,
}
REPLACE = {
    "operation": "replace_instruction",
    "instruction": "Put the other one there.",
    "alternate_goal": [{"predicate": "On", "arguments": ["box_1", "plate_1"]}],
    "alternate_task_id": "libero_goal/task_4",
}


def manifest(change: dict[str, Any], **scenario: Any) -> dict[str, Any]:
    """One case in the form of the authors' pairs that are scored by intent."""
    cancels = change["operation"] == "cancel_instruction"
    case = {
        "case_id": "libero_goal-t01-i0-intent-p195",
        "init_state_index": 0,
        "policy_seed": 195,
        "task_index": 1,
        "task_suite_name": "libero_goal",
        "timing_bucket": "middle",
        "scenario": {
            "base_task_id": "libero_goal/task_1",
            "change": change,
            "change_family": "INTENT",
            "change_type": "task_cancel" if cancels else "instruction_target_update",
            "expected_response_mode": "stop" if cancels else "follow_update",
            "safety_constraints": ["do_not_execute_superseded_goal"],
            "scenario_id": "libero_goal-t01-i0-intent",
            "seed": 7,
            "severity": "high" if cancels else "medium",
            "trigger": {"distance_m": 0.18, "type": "on_proximity", "value": "box_1"},
            **scenario,
        },
    }
    protocol = {
        "arms": ["control", "intervention"],
        "query_interval": 16,
        "scoring_track": "intent_response",
    }
    return {"benchmark_id": "mine", "benchmark_version": "1.0.0", "protocol": protocol, "cases": [case]}


@pytest.mark.parametrize("change", [CANCEL, REPLACE])
def test_a_manifest_of_intent_is_read_and_written_with_the_same_bytes(change: dict[str, Any]) -> None:
    document = manifest(change)
    read = parse_manifest(document)
    assert isinstance(read, Manifest)
    assert change_from_dict(change).to_dict() == change
    assert read.to_json() == json.dumps(document, indent=2, sort_keys=True) + "\n"
    check_cases(read)


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ({"change_family": "OBS"}, "'intent_response' is that of cases of 'INTENT' and no others"),
        ({"expected_response_mode": "continue"}, "'continue', but instruction_target_update expects 'follow"),
    ],
)
def test_a_case_that_contradicts_its_scoring_is_refused(scenario: dict[str, Any], message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        check_cases(parse_manifest(manifest(REPLACE, **scenario)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({**REPLACE, "alternate_goal": []}, "alternate_goal=.*non-empty list of predicates"),
        ({**REPLACE, "alternate_goal": [{"predicate": "On"}]}, "alternate_goal.*arguments"),
        ({**CANCEL, "stop_window_steps": 1}, "stop_window_steps=1, but must be an integer from 2 to 520"),
    ],
)
def test_a_malformed_change_of_intent_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ChangeError, match=message):
        change_from_dict(change)


class Listening(Approaching):
    """Approaches, and does something else from the first query with another instruction on."""

    def __init__(self, then: Callable[[int], Any]) -> None:
        super().__init__(wait=2, horizon=4, interval=4)
        self.then = then

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        actions = super().predict(observation, query)
        if query.instruction not in (CANCEL["instruction"], REPLACE["instruction"]):
            return actions
        return np.array([self.then(query.step + step) for step in range(4)])


class Deciding(TinyWorld):
    """A tiny world that takes any goal."""

    def _check_goal(self, goal: Any) -> None:
        pass


def still(step: int) -> Any:
    return NOOP_ACTION


def shaking(step: int) -> Any:
    return (0.0, 0.0, 0.9 if step % 2 else -0.9, 0.0, 0.0, 0.0, -1.0)


def leaving(step: int) -> Any:
    return (0.0, 0.0, 0.5, 0.0, 0.0, 0.0, -1.0)


def cancelled_case() -> ShortCase:
    case = make_case(distance_m=0.3)
    return replace(case, event=replace(case.event, change=CANCEL))


@pytest.mark.parametrize(("then", "stopped"), [(still, True), (shaking, False), (leaving, False)])
def test_a_cancelled_task_is_scored_by_standing_still(then: Callable[[int], Any], stopped: bool) -> None:
    pair = measure_pair(cancelled_case(), TinyWorld(), Listening(then))
    dynamic = pair.record.arms["dynamic"]
    assert dynamic.firings[0].evidence["operation"] == "cancel_instruction"
    assert (dynamic.success, dynamic.steps) == (stopped, BUDGET)
    assert pair.record.arms["base"].success is False


def playing(*schedule: dict[str, Any]) -> ShortCase:
    """The cancelled case, with a schedule of its own in Dynamic."""
    program = {"name": "own", "arms": [{"name": "dynamic", "schedule": list(schedule)}]}
    return replace(cancelled_case(), program=parse_program(program))


def test_a_policy_that_is_not_asked_again_has_not_stopped() -> None:
    deaf = Approaching(wait=BUDGET, horizon=BUDGET, interval=BUDGET)
    case = playing({"trigger": {"type": "budget_fraction", "value": 0.5}, "change": "event"})
    dynamic = measure_pair(case, TinyWorld(), deaf).record.arms["dynamic"]
    assert (dynamic.response_step, dynamic.success) == (None, False)


@pytest.mark.parametrize("completed", [30, 45])
def test_a_policy_that_completes_what_was_cancelled_has_not_stopped(completed: int) -> None:
    """Also where the goal holds for a moment only, long after the steps that are looked at."""
    world = Solvable(lambda world: policy_steps(world) == completed)
    record = measure_pair(cancelled_case(), world, Listening(still)).record
    dynamic = record.arms["dynamic"]
    assert (record.arms["base"].steps, record.base_success) == (completed, True)
    assert (dynamic.success, dynamic.steps) == (False, BUDGET)
    found = diagnose(record, "dynamic")
    assert found is not None
    assert found.cause == "not_stopped"
    assert found.sentence.startswith("The task was cancelled at step ")


def test_a_cancellation_that_is_taken_back_leaves_the_task_as_it_was() -> None:
    case = playing(
        {"trigger": "event", "change": "event"},
        {"trigger": {"type": "steps_after", "steps": 6}, "reverts": 0},
    )
    world = Solvable(lambda world: policy_steps(world) >= 40)
    dynamic = measure_pair(case, world, Listening(still)).record.arms["dynamic"]
    assert (dynamic.success, dynamic.steps) == (True, 40)


def test_another_goal_is_what_counts_from_then_on() -> None:
    case = make_case(distance_m=0.3)
    case = replace(case, event=replace(case.event, change=REPLACE))
    evidence = measure_pair(case, Deciding(), Listening(still)).record.arms["dynamic"].firings[0].evidence
    assert evidence["operation"] == "replace_instruction"
    assert evidence["after"] == {
        "instruction": "Put the other one there.",
        "goal": [["on", "box_1", "plate_1"]],
    }
