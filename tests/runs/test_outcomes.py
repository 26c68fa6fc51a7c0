from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.runs.outcomes import read_outcomes
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, read_pairs
from pytest_libero_max.worlds.rendering.context import RENDERER, VERSION
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, records_of


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return _written(tmp_path / "run", seed=0)


def _written(folder: Path, seed: int) -> Path:
    pairs = plan()
    store = PairStore(folder, Run(tuple(pairs), PROVENANCE))
    store.append(error_of(pairs[0]))
    store.append(record_of(pairs[0], True, False, fingerprints=_drawn_by("26.2.6")))
    store.append(record_of(pairs[1], True, True, **NEVER_TRIGGERED, fingerprints=_drawn_by("22.3.6")))
    for record in records_of(pairs[2:], seed):
        store.append(record)
    store.close()
    return folder


def _drawn_by(mesa: str) -> dict[str, str]:
    return {"substrate": "embedded", RENDERER: "llvmpipe", VERSION: f"4.5 Mesa {mesa}"}


def test_outcomes_are_what_the_records_say(folder: Path) -> None:
    read, stored = read_outcomes(folder), read_pairs(folder)
    assert read.renderers == ("llvmpipe, OpenGL 4.5 Mesa 22.3.6", "llvmpipe, OpenGL 4.5 Mesa 26.2.6")
    assert read.case_ids == tuple(record.case_id for record in stored.records)
    assert read.pairs.dynamic.tolist() == [record.dynamic_success for record in stored.records]
    assert read.played[1].triggered is False
    assert [pair.max_steps for pair in read.played] == [record.max_steps for record in stored.records]
