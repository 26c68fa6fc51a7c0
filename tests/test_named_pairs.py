"""The pairs that the Markdown files name can be played."""

from __future__ import annotations

import re

from pytest_libero_max.benchmark.tracks import load_track, track_names
from tests.test_documents import DOCUMENTS

ID = re.compile(r"\b(?:libero|plus|pro)-\w+-t\d\d[\w-]*-v[01]\b")


def test_every_pair_that_a_document_names_is_in_a_track() -> None:
    known = {case.item_id for track in track_names() for case in load_track(track)}
    named = {(path.name, id) for path in DOCUMENTS for id in ID.findall(path.read_text(encoding="utf-8"))}
    assert named
    assert [f"{name}: {id}" for name, id in sorted(named) if id not in known] == []
