from __future__ import annotations

import re

import numpy as np
import pytest

from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.substrates.contract import Substrate
from tests.reference import COMMAND, EXCERPTS, PAGES, ROOT, SCHEMAS, file_text, page_text, schema_text
from tests.reference.excerpts import HEADING
from tests.reference.worlds import OBSERVATIONS

_EMPTY_LAST_CELL = re.compile(r"^\|.*\|\s*\|$|^- `[^`]+`:\s*$", re.M)


@pytest.mark.parametrize("name", PAGES)
def test_every_page_is_what_the_code_says(name: str) -> None:
    committed = (ROOT / name).read_text(encoding="utf-8")
    assert committed == page_text(name), f"{name} is out of date. Write it again: {COMMAND}"


@pytest.mark.parametrize("name", EXCERPTS)
def test_a_page_shows_what_the_terminal_says_of_the_published_run(name: str) -> None:
    committed = (ROOT / name).read_text(encoding="utf-8")
    assert "McNemar" in committed.partition(HEADING)[2]
    assert committed == file_text(name), f"{name} is out of date. Write it again: {COMMAND}"


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_schema_is_what_the_structs_say(name: str) -> None:
    committed = (ROOT / name).read_text(encoding="utf-8")
    assert committed == schema_text(name), f"{name} is out of date. Write it again: {COMMAND}"


@pytest.mark.parametrize("name", PAGES)
def test_every_row_of_a_page_says_what_it_means(name: str) -> None:
    silent = _EMPTY_LAST_CELL.findall(page_text(name).replace("|  |  |", "").replace("| --- | --- |", ""))
    assert not silent, f"{name} has rows without a meaning; describe these in the code: {silent}"


def test_an_observation_holds_what_the_page_of_the_worlds_says(substrate: Substrate) -> None:
    world = substrate.world(load_track("original").cases[0])
    world.reset(0)
    seen = world.observe(size=64)
    assert seen.keys() == OBSERVATIONS.keys()
    for name, (shape, dtype, _) in OBSERVATIONS.items():
        assert str(np.shape(seen[name])) == shape.replace("size", "64"), name
        assert str(seen[name].dtype) == dtype, name
