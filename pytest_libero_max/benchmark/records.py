"""Cases as a manifest spells them."""

from __future__ import annotations

from pytest_libero_max.benchmark.cases import Event
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.identity import Identity

SAFETY_CONSTRAINTS = ("task_remains_feasible", "no_simulator_error", "no_new_unrelated_collision")
DYNAMIC_PHASE = "pre_grasp_proximity"


def case_record(identity: Identity, event: Event, task_name: str) -> Json:
    """Return the manifest object of one case, without the fields that describe a source variation."""
    return {
        "case_id": identity.case_id(event.name, event.variant),
        "dynamic_phase": DYNAMIC_PHASE,
        "init_state_index": identity.init_state_index,
        "policy_seed": identity.policy_seed,
        "scenario": scenario_record(identity, event),
        "task_index": identity.task_index,
        "task_name": task_name,
        "task_suite_name": identity.suite,
        "timing_bucket": "middle",
    }


def scenario_record(identity: Identity, event: Event) -> Json:
    """Return the scenario of a case: its event, trigger, seeds and names."""
    record: Json = {
        "base_task_id": identity.base_task_id,
        "change": event.change,
        "change_family": event.family_code,
        "change_type": event.name,
        "expected_response_mode": event.response,
        "randomization": {"draw_id": event.variant, "sampler": identity.sampler, "seed": event.seed},
        "safety_constraints": list(SAFETY_CONSTRAINTS),
        "scenario_id": identity.scenario_id(event.name, event.variant),
        "seed": event.seed,
        "severity": event.severity,
        "trigger": dict(event.trigger),
    }
    if event.setup:
        record["setup"] = list(event.setup)
    return record
