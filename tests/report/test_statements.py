from __future__ import annotations

import re

from pytest_libero_max.benchmark.tracks import load_track, unexamined_cases
from pytest_libero_max.report.published import authors_cases
from pytest_libero_max.report.statements import OWN_CASES, own_cases_text, statements_of


def test_what_is_said_of_screening_holds_for_the_cases_of_the_run() -> None:
    embedded = statements_of("track lite", [case.case_id for case in load_track("lite")])["screening"]
    assert not re.search(r"\d", embedded)
    ids = [case.case_id for case in load_track("genuine/lite")]
    unexamined = unexamined_cases("genuine/lite")
    genuine = statements_of("track genuine/lite", ids)["screening"]
    assert re.findall(r"\d+", genuine) == ["598", "800", "202"]
    examined = [one for one in ids if one not in unexamined]
    assert statements_of("track genuine/lite", examined)["screening"] == embedded
    own = statements_of("manifest mine.json", ids)["screening"]
    assert own.startswith("Nothing is known")


def test_genuine_tracks_are_said_to_be_other_cases_than_the_authors() -> None:
    suites = [case.suite for case in load_track("genuine/max")]
    text = own_cases_text("track genuine/max", suites)
    assert text is not None
    assert text.startswith(OWN_CASES)
    assert re.findall(r"(libero_\w+) ([\d,]+) and ([\d,]+)", text) == [
        ("libero_10", "2,008", "2,028,"),
        ("libero_goal", "1,537", "1,656,"),
        ("libero_object", "2,702", "2,448,"),
        ("libero_spatial", "1,753", "1,868"),
    ]
    assert sum(authors_cases().values()) == 8000
    assert (own_cases_text("track genuine/smoke", ["libero_goal"]) or "").endswith("json all.")
    assert own_cases_text("track lite", suites) is None
    assert own_cases_text("manifest libero_max_8000.json", suites) is None


def test_the_papers_own_lite_is_not_called_other_cases_and_its_screening_is_the_authors() -> None:
    cases = [case.case_id for case in load_track("genuine/paper-lite")]
    assert own_cases_text("track genuine/paper-lite", ["libero_goal"] * 800) is None
    assert "authors screened" in statements_of("track genuine/paper-lite", cases)["screening"]
