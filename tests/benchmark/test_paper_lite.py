"""The track of the authors' own Lite, against their release."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.tracks import load_track

INDEX = Path(__file__).parents[3] / "shared" / "official" / "lite_case_index.csv"
TRACK = "genuine/paper-lite"


def test_the_track_is_the_file_that_the_authors_released() -> None:
    track = load_track(TRACK)
    assert track.recognition is not None
    assert track.recognition.identical
    assert str(track.recognition) == "the authors' libero_max_lite.json 3.0.0"
    assert set(Counter((case.event.name, case.source) for case in track).values()) == {70, 30}


@pytest.mark.skipif(not INDEX.is_file(), reason="the authors' index is not here")
def test_the_track_has_the_cases_of_their_index_in_its_order() -> None:
    with INDEX.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cases = load_track(TRACK).cases
    assert [case.case_id for case in cases] == [row["case_id"] for row in rows]
    assert [case.record["substrate_category"] for case in cases] == [
        row["substrate_category"] for row in rows
    ]
