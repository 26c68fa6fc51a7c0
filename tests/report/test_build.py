from __future__ import annotations

from itertools import cycle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from pytest_libero_max.errors import ReportError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.report_files import report_json
from pytest_libero_max.runs.plan import PlannedPair
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plain, plan, record_of, records_of


def _numbers(value: object) -> list[float]:
    if isinstance(value, dict):
        return [number for item in value.values() for number in _numbers(item)]
    if isinstance(value, list):
        return [number for item in value for number in _numbers(item)]
    return [value] if isinstance(value, float) else []


def test_a_complete_run_counts_every_pair_once() -> None:
    pairs = plan()
    outcomes = {0: (True, True), 1: (True, False), 2: (False, True), 3: (False, False)}
    records = [record_of(pair, *outcomes[index % 4]) for index, pair in enumerate(pairs)]
    report = build_report(records, [], pairs, PROVENANCE)
    assert plain(report)["pairs"] == {
        "planned": 32,
        "played": 32,
        "invalid": 0,
        "missing": 0,
        "complete": True,
        "invalid_pairs": [],
        "missing_shards": [],
        "unsupported": 0,
        "unsupported_suites": [],
        "missing_pairs": [],
        "repaired_pairs": [],
        "stopped": None,
    }
    assert plain(report)["overall"]["outcomes"] == {
        "preserved_success": 8,
        "change_associated_success": 8,
        "regression": 8,
        "persistent_failure": 8,
    }
    assert plain(report)["headline"]["status"] == "complete"
    assert plain(report)["headline"]["base_success"]["count"] == 16
    assert plain(report)["headline"]["base_success"]["of"] == 32
    assert plain(report)["headline"]["paired_change"]["value"] == 0.0
    assert plain(report)["overall"]["mcnemar"]["p_value"] == 1.0


def test_every_breakdown_holds_every_pair() -> None:
    programs = cycle(("later", "there_and_back"))
    pairs = [structs.replace(pair, item_id=f"{pair.item_id}-{next(programs)}") for pair in plan(per_cell=2)]
    report = build_report(records_of(pairs), [], pairs, PROVENANCE)
    for groups in plain(report)["by"].values():
        for side in ("planned", "played"):
            assert sum(block[side] for block in groups.values()) == len(pairs)
        for name in plain(report)["overall"]["outcomes"]:
            total = sum(block["outcomes"][name] for block in groups.values())
            assert total == plain(report)["overall"]["outcomes"][name]
    assert list(plain(report)["by"]["event"]) == list(BENCHMARK_EVENTS)
    assert list(plain(report)["by"]["variant"])[:4] == [
        "illumination_switch-v0",
        "illumination_switch-v1",
        "camera_shift-v0",
        "camera_shift-v1",
    ]
    assert list(plain(report)["by"]["category"]) == ["plus-camera_viewpoints", "pro-position"]
    assert list(plain(report)["by"]["difficulty"]) == ["3", "none"]
    assert list(plain(report)["by"]["program"]) == ["later", "there_and_back"]
    assert "| there_and_back | 32 of 32 |" in markdown(report)


def test_pairs_without_a_program_are_in_no_group_of_programs() -> None:
    report = build_report(records_of(plan()), [], plan(), PROVENANCE)
    assert report.by["program"] == {}
    assert "## Program" not in markdown(report)


@pytest.mark.parametrize(
    ("missing", "invalid", "words"),
    [(1, 0, "1 missing"), (0, 1, "1 invalid"), (2, 1, "1 invalid, 2 missing")],
)
def test_an_incomplete_run_has_no_headline(missing: int, invalid: int, words: str) -> None:
    pairs = plan()
    lost = missing + invalid
    errors = [error_of(pair) for pair in pairs[:invalid]]
    report = build_report(records_of(pairs[lost:]), errors, pairs, PROVENANCE)
    headline = plain(report)["headline"]
    assert headline["status"] == "withheld"
    assert headline["base_success"] is headline["dynamic_success"] is headline["paired_change"] is None
    assert words in headline["reason"]
    assert f"{32 - lost} of 32" in headline["reason"]
    assert [pair["case_id"] for pair in plain(report)["pairs"]["missing_pairs"]] == sorted(
        pair.case_id for pair in pairs[invalid:lost]
    )
    assert [pair["kind"] for pair in plain(report)["pairs"]["invalid_pairs"]] == ["SimulatorError"] * invalid
    assert plain(report)["overall"]["played"] == 32 - lost
    assert plain(report)["overall"]["base_success"]["of"] == 32 - lost


def test_an_error_that_was_repaired_does_not_count() -> None:
    pairs = plan()
    report = build_report(records_of(pairs), [error_of(pairs[0])], pairs, PROVENANCE)
    assert plain(report)["pairs"]["complete"]
    assert plain(report)["pairs"]["invalid"] == 0


def test_nothing_played_gives_counts_and_no_rate() -> None:
    pairs = plan()
    report = build_report([], [error_of(pair) for pair in pairs], pairs, PROVENANCE)
    assert plain(report)["policy"] is None
    assert plain(report)["overall"]["base_success"] == {
        "count": 0,
        "of": 0,
        "value": None,
        "lower": None,
        "upper": None,
    }
    assert plain(report)["overall"]["mcnemar"]["p_value"] is None
    assert plain(report)["overall"]["stale_actions"]["mean"] is None
    assert plain(report)["macro"]["category"]["base_success"] is None
    assert plain(report)["largest_split"] is None
    report_json(report)


def test_an_untriggered_pair_stays_in_the_denominator() -> None:
    pairs = plan()
    records = [
        record_of(pair, True, True, **(NEVER_TRIGGERED if index < 8 else {}))
        for index, pair in enumerate(pairs)
    ]
    report = build_report(records, [], pairs, PROVENANCE)
    overall = plain(report)["overall"]
    assert overall["base_success"]["of"] == 32
    assert (overall["trigger_coverage"]["count"], overall["trigger_coverage"]["of"]) == (24, 32)
    assert overall["response_coverage"]["value"] == 0.75
    assert overall["given_response"]["base_success"]["of"] == 24
    assert overall["stale_actions"]["pairs"] == 24


def test_the_report_of_the_embedded_substrate_says_what_it_is_not() -> None:
    pairs = plan()
    records = records_of(pairs)
    report = build_report(records, [], pairs, PROVENANCE)
    assert plain(report)["substrate"]["scores_comparable_with_published"] is False
    assert plain(report)["substrate"]["note"]
    genuine = build_report(records, [], pairs, {**PROVENANCE, "substrate": {"name": "libero"}})
    assert plain(genuine)["substrate"]["scores_comparable_with_published"] is None


def test_a_run_on_a_substrate_that_is_not_installed_here_says_what_it_recorded() -> None:
    pairs = plan()
    elsewhere = {**PROVENANCE, "substrate": {"name": "another"}}
    report = build_report(records_of(pairs), [], pairs, elsewhere)
    assert " another substrate" in plain(report)["substrate"]["note"]
    scores = {"comparable_with_published": None, "note": "On another simulator."}
    report = build_report(records_of(pairs), [], pairs, {**elsewhere, "scores": scores})
    assert plain(report)["substrate"] == {
        "name": "another",
        "scores_comparable_with_published": None,
        "note": "On another simulator.",
    }


def test_the_policy_is_the_one_the_records_name() -> None:
    pairs = plan()
    records = records_of(pairs)
    assert plain(build_report(records, [], pairs, PROVENANCE))["policy"] == records[0].policy
    mixed = [*records[:-1], record_of(pairs[-1], True, True, policy={**records[0].policy, "name": "other"})]
    with pytest.raises(ReportError, match="several policies"):
        build_report(mixed, [], pairs, PROVENANCE)


def test_files_that_the_policy_wrote_make_no_second_policy() -> None:
    pairs = plan()
    records = records_of(pairs)
    digest = {"bytes": 1, "sha256": "a" * 64}

    def build(last: dict[str, Any]) -> object:
        record = record_of(pairs[-1], True, True, policy={**records[0].policy, **last})
        return build_report([with_files(r) for r in records[:-1]] + [record], [], pairs, PROVENANCE)

    def with_files(record: PairRecord) -> PairRecord:
        return structs.replace(record, policy={**record.policy, "files": {"c": digest}})

    build({"files": {"c": {"written": "since loading began"}}})
    build({"files": {"c": digest}, "reset_files": {"task_1": digest}})
    with pytest.raises(ReportError, match="several policies"):
        build({"files": {"c": {**digest, "bytes": 2}}})


def test_a_pair_measured_twice_is_refused() -> None:
    pairs = plan()
    records = records_of(pairs)
    with pytest.raises(ReportError, match="measured twice"):
        build_report([*records, records[0]], [], pairs, PROVENANCE)


def test_a_pair_that_was_not_planned_is_refused() -> None:
    pairs = plan()
    with pytest.raises(ReportError, match="not planned"):
        build_report(records_of(pairs), [], pairs[1:], PROVENANCE)
    with pytest.raises(ReportError, match="not planned"):
        build_report([], [error_of(pairs[0])], pairs[1:], PROVENANCE)


def test_a_record_of_another_case_of_the_same_name_is_refused() -> None:
    pairs = plan()
    with pytest.raises(ReportError, match="another case"):
        build_report([record_of(pairs[0], True, True, case_digest="0" * 64)], [], pairs, PROVENANCE)


def _run(fates: list[int]) -> tuple[list[PlannedPair], list[PairRecord], list[PairError]]:
    """Fates 0 to 3 are the outcomes, 4 an error, 5 a missing pair."""
    fated = list(zip(plan(), fates, strict=True))
    records = [record_of(pair, fate % 2 == 0, fate < 2) for pair, fate in fated if fate < 4]
    return plan(), records, [error_of(pair) for pair, fate in fated if fate == 4]


RUNS = st.lists(st.integers(0, 5), min_size=32, max_size=32).map(_run)


@settings(max_examples=3, deadline=None)
@given(data=st.data())
def test_the_order_of_pairs_never_shows(data: st.DataObject) -> None:
    pairs, records, errors = data.draw(RUNS)
    before = report_json(build_report(records, errors, pairs, PROVENANCE))
    after = report_json(
        build_report(
            data.draw(st.permutations(records)),
            data.draw(st.permutations(errors)),
            data.draw(st.permutations(pairs)),
            PROVENANCE,
        )
    )
    assert before == after


@settings(max_examples=6, deadline=None)
@given(data=st.data())
def test_planned_is_played_and_invalid_and_missing(data: st.DataObject) -> None:
    pairs, records, errors = data.draw(RUNS)
    report = build_report(records, errors, pairs, PROVENANCE)
    counts = plain(report)["pairs"]
    assert counts["planned"] == counts["played"] + counts["invalid"] + counts["missing"] == len(pairs)
    assert (plain(report)["headline"]["status"] == "complete") == (len(records) == len(pairs))
    assert sum(plain(report)["overall"]["outcomes"].values()) == len(records)
    assert all(abs(number) < float("inf") for number in _numbers(report))
