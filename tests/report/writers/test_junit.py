from __future__ import annotations

from pytest_libero_max.report.writers.junit import properties
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
    ]


def test_what_does_not_exist_is_left_out() -> None:
    values = dict(properties(record_of(plan()[0], True, True, **NEVER_TRIGGERED)))
    assert values["libero_max_triggered"] == "false"
    assert not values.keys() & {
        "libero_max_trigger_step",
        "libero_max_response_step",
        "libero_max_stale_actions",
        "libero_max_prefix_digest",
    }
