from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.runs import outcomes
from pytest_libero_max.runs.outcomes import RunOutcomes, read_outcomes
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


def _same(one: RunOutcomes, other: RunOutcomes) -> bool:
    columns = zip(vars(one.pairs).values(), vars(other.pairs).values(), strict=True)
    return (
        one.run == other.run
        and one.case_ids == other.case_ids
        and one.policy == other.policy
        and (one.scenes, one.renderers, one.played) == (other.scenes, other.renderers, other.played)
        and all(np.array_equal(first, second) for first, second in columns)
    )


def test_the_fast_way_says_what_the_records_say(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = RunOutcomes.of(read_pairs(folder))
    assert expected.renderers == ("llvmpipe, OpenGL 4.5 Mesa 22.3.6", "llvmpipe, OpenGL 4.5 Mesa 26.2.6")
    monkeypatch.setattr(outcomes, "read_pairs", lambda path: pytest.fail("all of the records was decoded"))
    assert _same(read_outcomes(folder), expected)
    assert _same(read_outcomes(folder / "pairs.jsonl"), expected)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b'"scripted"', b'"another"', "with different things"),
        (b'"case_digest":"', b'"case_digest":"0', "case_digest"),
        (b'"success":', b'"sucess":', "has the unknown field 'sucess'"),
    ],
)
def test_a_line_that_is_not_as_expected_is_read_whole_and_named(
    folder: Path, old: bytes, new: bytes, message: str
) -> None:
    path = folder / "pairs.jsonl"
    *lines, last = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines) + last.replace(old, new, 1))
    with pytest.raises(ReportError, match=message):
        read_outcomes(folder)


def test_what_is_wrong_with_the_records_is_said(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="Cannot read"):
        read_outcomes(tmp_path)
