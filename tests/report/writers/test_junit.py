from __future__ import annotations

from pytest_libero_max.report.diagnosis import changed_pairs
from pytest_libero_max.report.writers.junit import broken_properties, properties
from tests.report.made_up import NEVER_TRIGGERED, plan, record_of


def test_properties_of_a_regression() -> None:
    pair = plan()[0]
    assert properties(record_of(pair, True, False)) == [
        ("libero_max_case_id", "plus-spatial-t00-illumination_switch-v0"),
        ("libero_max_outcome", "regression"),
        ("libero_max_base_success", "true"),
        ("libero_max_dynamic_success", "false"),
        ("libero_max_triggered", "true"),
        ("libero_max_responded", "true"),
        ("libero_max_base_steps", "90"),
        ("libero_max_dynamic_steps", "95"),
        ("libero_max_trigger_step", "23"),
        ("libero_max_response_step", "25"),
        ("libero_max_stale_actions", "2"),
        ("libero_max_prefix_digest", "ab" * 32),
        ("libero_max_cause", "not_recorded"),
        ("libero_max_diagnosis", "The record holds no stages."),
    ]


def test_the_suite_names_the_pairs_whose_outcome_changed() -> None:
    first, second, third = plan()[:3]
    records = [record_of(first, True, False), record_of(second, False, True), record_of(third, True, True)]
    said = "not_recorded: The record holds no stages."
    assert broken_properties(changed_pairs(records)) == [
        ("libero_max_regression", f"R {first.item_id}, {first.event}, {said}"),
        ("libero_max_change_associated_success", f"G {second.item_id}, {second.event}, {said}"),
    ]


def test_what_does_not_exist_is_left_out() -> None:
    values = dict(properties(record_of(plan()[0], True, True, **NEVER_TRIGGERED)))
    assert "libero_max_cause" not in values
    assert values["libero_max_triggered"] == "false"
    assert not values.keys() & {
        "libero_max_trigger_step",
        "libero_max_response_step",
        "libero_max_stale_actions",
        "libero_max_prefix_digest",
    }
