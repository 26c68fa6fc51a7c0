"""What a page of a run holds beside its tables: the data of the table of cases, the events, the frame."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.trace import trace_name
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.case_table import ORDER, flat, label_column, run_cases, timeline_of
from pytest_libero_max.report.page.events import events_of
from pytest_libero_max.report.page.origin import origin_rows
from pytest_libero_max.report.page.page_frame import compressed
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.plots import OUTCOME_TITLES
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.writers.report_files import run_page
from pytest_libero_max.runs.plan import PlannedPair
from pytest_libero_max.runs.store import StoredRun, read_pairs
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, run_of

PAIRS = plan()
UNSUPPORTED = structs.replace(PAIRS[9], suite="libero_goal")
PUBLISHED = Path(__file__).parents[3] / "reports" / "smoke" / "stale_expert" / "pairs.jsonl.gz"
MOST_BYTES_A_CASE = 600
"""8,000 cases then take 4.8 MB; a whole page is to stay below 5 MB."""


def _run() -> StoredRun:
    """The first pair has no record, the second an error, the third no event, the fourth another suite."""
    planned = [*PAIRS[:3], UNSUPPORTED, *PAIRS[10:]]
    policy = {**record_of(PAIRS[2], True, True).policy, "suites": ["libero_spatial"], "revision": "abc"}
    records = [
        record_of(PAIRS[2], False, False, policy=policy, **NEVER_TRIGGERED),
        *(record_of(pair, True, index % 2 == 0, policy=policy) for index, pair in enumerate(PAIRS[10:])),
    ]
    return run_of(planned, records, errors=[error_of(PAIRS[1])])


def _column(cases: Json, key: str) -> dict[str, object]:
    """The values of a column by item id."""
    (column,) = (column for column in cases["columns"] if column["key"] == key)
    values = column.get("values") or [column["labels"][place] for place in column["at"]]
    return dict(zip(cases["items"], values, strict=True))


def test_every_planned_pair_is_in_the_table_whatever_became_of_it() -> None:
    run = _run()
    cases = run_cases(run, {}, {})
    places = [ORDER.index(_column(cases, "outcome")[item]) for item in cases["items"]]
    order = [*zip(places, cases["items"], strict=True)]
    assert order == sorted(order)  # regressions first, each outcome by name
    outcomes = _column(cases, "outcome")
    fired = _column(cases, "fired")
    assert (fired[PAIRS[1].item_id], fired[PAIRS[2].item_id], fired[PAIRS[10].item_id]) == (
        "not played",
        "never",
        "yes",
    )
    assert [outcomes[pair.item_id] for pair in run.run.planned[:4]] == [
        "missing",
        "invalid",
        "persistent_failure",
        "unsupported",
    ]
    assert {*outcomes.values()} <= {*OUTCOME_TITLES}
    assert _column(cases, "stale")[PAIRS[2].item_id] is None
    assert _column(cases, "dynamic_steps")[PAIRS[10].item_id] == 95
    details = dict(zip(cases["items"], cases["details"], strict=True))
    assert details[PAIRS[1].item_id]["tables"]["Error"]["Message"] == run.errors[0].message
    assert details[PAIRS[2].item_id]["tables"]["Event"] == {"Happened": False}
    assert details[PAIRS[10].item_id]["tables"]["Arms"]["Success"] == {"base": True, "dynamic": True}


def _offered(cases: Json, item: str) -> list[str]:
    """The commands that the page offers for a case, by the words that tell them apart."""
    has = {*cases["has"][str(cases["items"].index(item))]}
    words = ("pytest", "--libero-max-film=all", "film", "--view=policy", "rerun", "list")
    return [
        " ".join(word for word in words if word in f"{command['before']} {command['after']}".split())
        for command in cases["commands"]
        if has >= {*command["needs"]} and not has & {*command["unless"]}
    ]


def test_commands_are_those_that_make_what_is_not_there(tmp_path: Path) -> None:
    run, item = _run(), PAIRS[10].item_id
    (tmp_path / "traces").mkdir()
    (tmp_path / "traces" / trace_name(item)).touch()
    film, seen = f"films/{item}--base-dynamic.mp4", f"films/{item}--base-dynamic--policy.mp4"
    assert _offered(run_cases(run, {}, {}), item) == ["pytest", "pytest --libero-max-film=all", "list"]
    assert _offered(run_cases(run, {}, {}), PAIRS[1].item_id) == ["pytest", "list"]
    assert _offered(run_cases(run, {}, {}, tmp_path), item) == ["pytest", "film", "rerun", "list"]
    filmed = run_cases(run, {item: [film]}, {}, tmp_path)
    assert _offered(filmed, item) == ["pytest", "film --view=policy", "rerun"]
    assert _offered(run_cases(run, {item: [film, seen]}, {}, tmp_path), item) == ["pytest", "rerun"]
    pictured = run_cases(run, {}, {item: [f"pictures/{item}--a-before.png"]}, tmp_path)
    assert _offered(pictured, item) == ["pytest", "film", "rerun"]
    (play, _, with_film, from_trace, *_) = filmed["commands"]
    assert (play["before"].split()[0], play["before"].split()[-1], play["after"]) == ("pytest", "-k", "")
    assert with_film["before"].endswith(" --libero-max-film=all -k")
    assert from_trace["before"] == "libero-max film ."


def test_a_filmed_pair_has_the_moments_of_its_film_and_the_curves_of_its_trace(tmp_path: Path) -> None:
    record = record_of(PAIRS[10], True, False, dynamic_steps=220)
    assert record.trigger is not None
    assert timeline_of(record) == {
        "steps": 220,
        "arms": {
            "base": {"end": record.base_steps, "success": True, "events": [], "stale": 0, "kind": "arm0"},
            "dynamic": {
                "end": 220,
                "success": False,
                "events": [record.trigger.step],
                "stale": 2,
                "kind": "arm1",
            },
        },
    }
    (tmp_path / "traces").mkdir()
    path = tmp_path / "traces" / trace_name(record.item_id)
    arrays: dict[str, Any] = {}
    for name, arm in record.arms.items():
        steps = arm.steps or 0
        arrays |= {f"{name}_actions": np.zeros((steps, 7)), f"{name}_query_steps": np.zeros(1, int)}
        arrays |= {
            f"{name}_end_effector": np.full((steps, 3), [0.3, 0, 0.4]),
            f"{name}_entity": np.zeros((steps, 3)),
        }
    np.savez(path, **arrays)
    drawn = timeline_of(record, tmp_path)["arms"]["dynamic"]
    assert (drawn["every"], drawn["curve"]) == (2, [500] * 110)
    path.write_bytes(b"no trace")
    assert "curve" not in timeline_of(record, tmp_path)["arms"]["dynamic"]


def test_media_are_named_by_what_tells_them_apart_and_addressed_as_a_browser_wants_it() -> None:
    run, item = _run(), PAIRS[2].item_id
    cases = run_cases(
        run, {item: [f"films/{item}--base dynamic.mp4"]}, {item: [f"pictures/{item}--a-before.png"]}
    )
    place = str(cases["items"].index(item))
    assert cases["films"] == {place: [["base dynamic", f"films/{item}--base%20dynamic.mp4"]]}
    assert cases["pictures"] == {place: [["a-before", f"pictures/{item}--a-before.png"]]}
    assert _column(cases, "film")[item] == "yes"
    assert "film" not in [column["key"] for column in run_cases(run, {}, {})["columns"]]


@pytest.mark.skipif(not PUBLISHED.is_file(), reason="the source distribution has no reports")
def test_a_case_takes_little_space_on_the_page() -> None:
    cases = run_cases(read_pairs(PUBLISHED), {}, {})
    assert len(compressed(cases)) / len(cases["items"]) < MOST_BYTES_A_CASE


def test_names_are_in_the_order_asked_for_and_then_by_the_alphabet() -> None:
    column = label_column("key", "Title", ["b", "z", "a", "b"], ["z", "q"])
    assert (column["labels"], column["at"]) == (["z", "a", "b"], [2, 0, 1, 2])


def test_nested_values_are_named_by_their_way() -> None:
    assert dict(flat({"a": {"b": 1, "c": {}}, "d": [2]})) == {"a.b": 1, "a.c": None, "d": [2]}


def test_an_event_is_shown_with_its_picture_and_the_parameters_that_all_its_cases_have() -> None:
    if not PUBLISHED.is_file():
        pytest.skip("the source distribution has no reports")
    stored = read_pairs(PUBLISHED)
    planned = [pair for pair in stored.run.planned if pair.event_variant == "camera_shift-v1"]
    records = [record for record in stored.records if record.item_id in {pair.item_id for pair in planned}]
    (event,) = events_of(planned, records)
    assert event.name == "camera_shift-v1"
    facts = dict(event.facts)
    assert facts["change.yaw_degrees"] == "-22.0"
    assert facts["trigger.value"] == "differs between cases"
    assert events_of([]) == []


@pytest.mark.parametrize("pair", PAIRS, ids=lambda pair: pair.item_id)
def test_every_event_of_the_benchmark_has_a_picture(pair: PlannedPair) -> None:
    (event,) = events_of([pair])
    assert base64.b64decode(event.picture)[8:12] == b"WEBP"


def test_the_origin_says_what_was_recorded_and_what_was_not() -> None:
    provenance = {
        **PROVENANCE,
        "started": "2026-05-01T12:30:00+00:00",
        "platform": {**PROVENANCE["platform"], "processor": "A processor", "cores": 8},
        "policy": {**PROVENANCE["policy"], "profile": "mine"},
    }
    report = structs.replace(_report(), provenance=provenance)
    rows = dict(origin_rows(report, _run()))
    assert (rows["date"], rows["profile"]) == ("2026-05-01T12:30:00+00:00", "mine")
    assert rows["machine"] == "Linux, x86_64, 2.36, A processor, 8 cores"
    rows = dict(origin_rows(_report(), _run()))
    assert rows["policy"] == "scripted, revision abc"
    assert rows["date"] == "not recorded"
    assert rows["machine"] == "Linux, x86_64, 2.36"


def test_a_page_may_run_its_own_script_and_load_from_its_own_folder_alone() -> None:
    page = run_page(_report(), _run(), Path("nowhere"))
    assert page.count("data:image/webp;base64,") == page.count("<article class='event'") == 16
    assert "default-src 'none'" in page
    assert "script-src 'sha256-" in page
    assert set(re.findall(r"https?://[^'\"<\s]*", page)) <= {"http://www.w3.org/2000/svg"}
    assert "script-src 'none'" in html(_report(), [], [])


def _report() -> Report:
    run = _run()
    return build_report(run.records, run.errors, run.run.planned, run.run.provenance)


@pytest.mark.skipif(not PUBLISHED.is_file(), reason="the source distribution has no reports")
def test_causes_of_base_are_apart_from_those_of_what_was_lost() -> None:
    stored = read_pairs(PUBLISHED)
    cases = run_cases(stored, {}, {})
    outcome, lost, base = (_column(cases, key) for key in ("outcome", "cause", "base_cause"))
    assert {lost[item] != "none" for item in lost if outcome[item] == "regression"} == {True}
    assert {base[item] != "none" for item in base if outcome[item] == "persistent_failure"} == {True}
    assert all("none" in (lost[item], base[item]) for item in lost)
    (column,) = (column for column in cases["columns"] if column["key"] == "cause")
    assert column["cells"][column["labels"].index("none")] == ""
