"""The page about the controller says what was measured, and ``libero-max plan time`` counts with no less."""

from __future__ import annotations

import json
from pathlib import Path

from pytest_libero_max.cli import parser
from tests.scripts.answering_worker import PAIRS_NAME, REPORTS_NAME, Known
from tests.scripts.measure_controller import MEASURED, curve, page, read


def test_page_and_figure_are_made_from_what_was_measured() -> None:
    rows = read(MEASURED)
    assert MEASURED.with_suffix(".md").read_text() == page(rows)
    assert MEASURED.with_suffix(".svg").read_text() == curve(rows)


def test_a_plan_counts_with_no_less_than_the_dearest_run_took() -> None:
    record_ms = parser().parse_args(["plan", "time", "run"]).record_ms
    now = [row["pair_cpu_ms"] for row in read(MEASURED) if not row["before"]]
    assert max(now) <= record_ms < 2.0 * max(now)


def test_known_reports_are_sent_under_the_names_of_other_pairs(tmp_path: Path) -> None:
    record = json.dumps({"case_id": "a-v0", "policy_seed": 1, "steps": 11})
    report = {"nodeid": "x::test[a-v0]", "location": ["f.py", 3, "test[a-v0]"], "keywords": {"test[a-v0]": 1}}
    known = {"0": [{**report, "when": "call", "libero_max": record}]}
    (tmp_path / REPORTS_NAME).write_text(json.dumps(known))
    pairs = [{"nodeid": f"x::test[{name}-v0]", "case_id": f"{name}-v0", "policy_seed": 7} for name in "bc"]
    (tmp_path / PAIRS_NAME).write_text("".join(f"{json.dumps(pair)}\n" for pair in pairs))
    (sent,) = Known(tmp_path).reports(1)
    assert Known(tmp_path).ids() == ["x::test[b-v0]", "x::test[c-v0]"]
    assert sent["nodeid"] == "x::test[c-v0]"
    assert sent["location"] == ("f.py", 3, "test[c-v0]")
    assert sent["keywords"] == {"test[c-v0]": 1}
    assert json.loads(sent["libero_max"]) == {"case_id": "c-v0", "policy_seed": 7, "steps": 11}
