from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import compare_folders
from pytest_libero_max.report.writers.files import write_reports
from pytest_libero_max.runs import outcomes_file
from pytest_libero_max.runs.outcomes_file import OUTCOMES_NAME, RunOutcomes, read_outcomes
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, records_of


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return _written(tmp_path / "run", seed=0)


def _written(folder: Path, seed: int) -> Path:
    pairs = plan()
    store = PairStore(folder, Run(tuple(pairs), PROVENANCE))
    store.append(error_of(pairs[0]))
    store.append(record_of(pairs[0], True, False))
    store.append(record_of(pairs[1], True, True, **NEVER_TRIGGERED))
    for record in records_of(pairs[2:], seed):
        store.append(record)
    store.close()
    write_reports(folder)
    return folder


def _same(one: RunOutcomes, other: RunOutcomes) -> bool:
    columns = zip(vars(one.pairs).values(), vars(other.pairs).values(), strict=True)
    return (
        one.run == other.run
        and one.case_ids == other.case_ids
        and one.policy == other.policy
        and all(np.array_equal(first, second) for first, second in columns)
    )


def test_the_file_says_what_the_records_say(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = RunOutcomes.of(read_pairs(folder))
    monkeypatch.setattr(outcomes_file, "read_pairs", lambda path: pytest.fail("the records were read"))
    assert _same(read_outcomes(folder), expected)
    assert _same(read_outcomes(folder / "pairs.jsonl"), expected)


def test_a_file_of_other_records_is_ignored(folder: Path) -> None:
    path = folder / "pairs.jsonl"
    *lines, last = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines))
    assert len(read_outcomes(folder).case_ids) == 31
    path.write_text("".join(lines) + last.replace('"success":true', '"success":false'))
    assert _same(read_outcomes(folder), RunOutcomes.of(read_pairs(folder)))


@pytest.mark.parametrize(
    "damage",
    [
        lambda kept: "",
        lambda kept: "[]",
        lambda kept: json.dumps({**kept, "schema_version": 0}),
        lambda kept: json.dumps({key: value for key, value in kept.items() if key != "stale"}),
        lambda kept: json.dumps({**kept, "base": kept["base"][1:]}),
        lambda kept: json.dumps({**kept, "source": {"names": [], "places": kept["source"]["places"]}}),
    ],
)
def test_a_damaged_file_is_ignored(folder: Path, damage: object) -> None:
    path = folder / OUTCOMES_NAME
    assert callable(damage)
    text = damage(json.loads(path.read_text().splitlines()[1]))
    path.write_text(f"{hashlib.blake2b(text.encode(), digest_size=16).hexdigest()}\n{text}\n")
    assert _same(read_outcomes(folder), RunOutcomes.of(read_pairs(folder)))


def test_a_comparison_is_the_same_with_and_without_the_file(folder: Path, tmp_path: Path) -> None:
    other = _written(tmp_path / "other", seed=1)
    before = compare_folders([folder, other])
    for run in (folder, other):
        (run / OUTCOMES_NAME).unlink()
    assert compare_folders([folder, other]) == before


def test_what_is_wrong_with_the_records_is_said(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="Cannot read"):
        read_outcomes(tmp_path)
