"""Published results beside runs of the authors' cases, and pairs without a result as failures."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.releases import RELEASED
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.published import BESIDE_TITLE, published_beside, published_policies
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.stopped import Stopped
from tests.report.made_up import PROVENANCE, error_of, plain, plan, record_of, records_of

PAIRS = plan()
PAGE = Path(__file__).parents[2] / "reports" / "genuine" / "beside-the-paper.md"
RATES = Path(__file__).parents[3] / "shared" / "official" / "lite_rates.csv"


def _file(name: str) -> Any:
    return next(file for file in RELEASED if file.file == name)


def _report(released: str, played: int, semantics: str = "published") -> Report:
    """A report of made-up pairs that says it holds so many of a released file."""
    provenance: Json = {
        **PROVENANCE,
        "case_set": {"name": "manifest cases.json", "digest": "0" * 64, "released_as": released},
        "substrate": {
            "name": "libero",
            "semantics": semantics,
            "instruction_source": "published",
            "source_variations": "installed",
        },
    }
    report = build_report(records_of(PAIRS), [], PAIRS, provenance)
    return structs.replace(report, pairs=structs.replace(report.pairs, played=played))


def test_a_run_of_the_authors_8000_cases_stands_beside_the_published_rows() -> None:
    report = _report(str(_file("libero_max_8000.json")), 8000)
    beside = published_beside(report)
    assert beside is not None
    assert [row[0] for row in beside.rows[:2]] == ["scripted (this run)", "pi_0.5"]
    assert beside.texts()[1][1:] == ["79.7%", "65.7%", "-13.9", "50", "5", "2B VLM + 300M action expert"]
    assert len(beside.rows) == 15
    for text in (markdown(report), html(report, [], ["pytest"])):
        assert BESIDE_TITLE in text
        assert "DiT4DiT" in text


def test_the_authors_pro_cases_stand_beside_the_rows_of_that_source() -> None:
    beside = published_beside(_report(str(_file("libero_max_pro_hard_2400.json")), 2400))
    assert beside is not None
    assert beside.texts()[1][:4] == ["pi_0.5", "64.8%", "55.1%", "-9.7"]


def test_the_authors_lite_stands_beside_the_rates_of_lite() -> None:
    beside = published_beside(_report(str(_file("libero_max_lite.json")), 800))
    assert beside is not None
    assert beside.texts()[1][:4] == ["pi_0.5", "79.3%", "65.1%", "-14.1"]
    assert len(beside.rows) == 15


def test_their_lite_of_400_cases_has_no_rates_beside_it() -> None:
    (short,) = (file for file in RELEASED if file.cases == 400)
    assert published_beside(_report(str(short), 400)) is None


@pytest.mark.skipif(not RATES.is_file(), reason="the authors' rates are not here")
def test_the_rates_of_lite_are_those_of_the_authors_table() -> None:
    printed = {policy.name: policy.printed.lite for policy in published_policies()}
    names = {"pi0.5": "pi_0.5"}
    with RATES.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12
    for row in rows:
        rates = printed[names.get(row["model"], row["model"])]
        exact = [float(row[f"lite_{key}"]) for key in ("base_sr", "dynamic_sr", "gap")]
        assert rates == pytest.approx(exact, abs=0.0501)
    kept = sorted(int(row["lite_rows_archived"]) for row in rows)
    assert f"for {kept[0]} to {kept[-5]}" in PAGE.read_text()
    assert kept[-4:] == [800] * 4


@pytest.mark.parametrize(
    ("played", "semantics", "why"),
    [(7999, "published", "it has 7,999 of the 8,000 cases"), (8000, "corrected", "its semantics are not")],
)
def test_a_run_that_differs_has_no_rows_beside_it_and_says_why(played: int, semantics: str, why: str) -> None:
    report = _report(str(_file("libero_max_8000.json")), played, semantics)
    beside = published_beside(report)
    assert beside is not None
    assert not beside.rows
    assert why in beside.note
    assert why in markdown(report)
    assert "DiT4DiT" not in markdown(report)


def test_a_file_that_is_only_like_the_authors_has_nothing_beside_it() -> None:
    like = f"like {_file('libero_max_8000.json')}, but NOT that file: its SHA-256 is another"
    assert published_beside(_report(like, 8000)) is None
    assert published_beside(_report(str(_file("libero_max_pro_model_comparison_800.json")), 800)) is None
    assert BESIDE_TITLE not in markdown(build_report(records_of(PAIRS), [], PAIRS, PROVENANCE))


def test_pairs_without_a_result_count_as_failures_in_a_second_rate() -> None:
    records = [record_of(pair, True, index % 2 == 0) for index, pair in enumerate(PAIRS[:28])]
    report = build_report(records, [error_of(PAIRS[28])], PAIRS, PROVENANCE)
    assert report.headline.status == "withheld"
    rates = plain(report)["missing_as_failures"]
    assert rates["without_result"] == 4
    assert (rates["base_success"]["count"], rates["base_success"]["of"]) == (28, 32)
    assert (rates["dynamic_success"]["count"], rates["dynamic_success"]["of"]) == (14, 32)
    assert rates["paired_change"]["value"] == -14 / 32
    said = "If 4 pairs without a result counted as failures of both arms, as in the paper: Base 87.5%"
    flat = " ".join(" ".join(summary_lines(report)).split())
    for text in (flat, markdown(report), html(report, [], ["pytest"])):
        assert said in text
        assert "Not a score." in text


def test_no_second_rate_where_it_would_say_nothing() -> None:
    records = records_of(PAIRS)
    assert build_report(records, [], PAIRS, PROVENANCE).missing_as_failures is None
    assert build_report([], [], PAIRS, PROVENANCE).missing_as_failures is None
    stopped = Stopped("3 regressions", of=len(PAIRS), rule="first-regression", at=8)
    assert build_report(records[:8], [], PAIRS, PROVENANCE, stopped).missing_as_failures is None
    broken = structs.replace(stopped, rule=None, at=None)
    assert build_report(records[:8], [], PAIRS, PROVENANCE, broken).missing_as_failures is not None
