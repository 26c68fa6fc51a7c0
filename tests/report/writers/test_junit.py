from __future__ import annotations

import re
from html import escape

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.diagnosis import changed_pairs
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.render.markdown import markdown_text
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.junit import broken_properties, headline_properties, properties
from pytest_libero_max.report.writers.summary import summary_lines
from tests.report.made_up import NEVER_TRIGGERED, POLICY, PROVENANCE, plain, plan, record_of


def test_properties_of_a_regression() -> None:
    pair = plan()[0]
    (changed,) = changed_pairs([record_of(pair, True, False)])
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
        ("libero_max_diagnosis", changed.sentence),
    ]


def test_the_suite_names_the_pairs_whose_outcome_changed() -> None:
    first, second, third = plan()[:3]
    records = [record_of(first, True, False), record_of(second, False, True), record_of(third, True, True)]
    assert broken_properties(changed_pairs(records)) == [
        ("libero_max_regression", f"R {first.item_id}, {first.event}"),
        ("libero_max_change_associated_success", f"G {second.item_id}, {second.event}"),
    ]


def test_every_caveat_of_a_run_stands_in_all_of_its_files() -> None:
    pairs = plan()
    wrong = {
        "policy": {**POLICY, "repeatable": False},
        "fingerprints": {"substrate": "embedded", "mujoco": "3.9"},
    }
    records = [record_of(pair, False, False, **NEVER_TRIGGERED, **wrong) for pair in pairs]
    report = build_report(records, (), pairs, PROVENANCE)
    caveats = [value for name, value in headline_properties(report) if name == "libero_max_caveat"]
    assert any("0 of 32 pairs" in text for text in caveats)
    assert {*report.warnings, *map(caveat_text, report.caveats)} <= {*caveats}
    assert len(report.caveats) >= 2
    shown = re.sub("</?abbr[^>]*>", "", html(report, [], ["pytest"]))  # the meanings of words
    page, text = (" ".join(file.split()) for file in (shown, markdown(report)))
    assert all(markdown_text(caveat) in text for caveat in caveats)
    # "Not measurable" is the headline of a page, and the rest its first sentence.
    assert all(escape(caveat.removeprefix("Not measurable: "), quote=False) in page for caveat in caveats)
    assert plain(report)["warnings"] == report.warnings
    summary = " ".join(" ".join(summary_lines(report)).split())
    assert all(warning in summary for warning in report.warnings)


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
