from __future__ import annotations

import gzip
import json
import os
from pathlib import Path

import pytest

from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.report.run import Run
from pytest_libero_max.report.store import PairStore, read_pairs
from tests.report.made_up import PROVENANCE, error_of, plan, record_of


@pytest.fixture
def run() -> Run:
    return Run(tuple(plan()), PROVENANCE)


def test_what_is_appended_is_read_back(tmp_path: Path, run: Run) -> None:
    records = [record_of(pair, True, index % 2 == 0) for index, pair in enumerate(run.planned[:5])]
    error = error_of(run.planned[5])
    store = PairStore(tmp_path, run)
    pairs: list[PairRecord | PairError] = [*records[:3], error, *records[3:]]
    for pair in pairs:
        store.append(pair)
    store.close()
    stored = read_pairs(tmp_path)
    assert stored.run == run
    assert stored.records == tuple(records)
    assert stored.errors == (error,)
    assert not stored.torn
    assert stored.measured == {record.case_id for record in records}


def test_a_line_is_on_disk_before_the_next_pair(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    assert not store.path.exists()
    store.append(record_of(run.planned[0], True, True))
    assert len(read_pairs(store.path).records) == 1
    store.close()


def test_a_run_without_a_pair_still_says_what_was_planned(tmp_path: Path, run: Run) -> None:
    PairStore(tmp_path, run).close()
    assert read_pairs(tmp_path).run == run


def test_every_cut_of_the_last_line_loses_that_pair_and_no_other(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    for pair in run.planned[:2]:
        store.append(record_of(pair, True, False))
    store.close()
    content = store.path.read_bytes()
    last = content.rindex(b"\n", 0, -1) + 1
    for cut in (last + 1, last + 40, len(content) - 1):
        store.path.write_bytes(content[:cut])
        stored = read_pairs(store.path)
        assert stored.torn
        assert [record.case_id for record in stored.records] == [run.planned[0].case_id]


def test_damage_before_the_end_is_an_error_with_its_line(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    for pair in run.planned[:2]:
        store.append(record_of(pair, True, False))
    store.close()
    lines = store.path.read_text().splitlines(keepends=True)
    store.path.write_text(lines[0] + lines[1][:50] + "\n" + lines[2])
    with pytest.raises(ReportError, match=r"pairs\.jsonl, line 2: not JSON"):
        read_pairs(store.path)


def test_an_unknown_field_is_an_error_with_its_line(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, False))
    store.close()
    lines = store.path.read_text().splitlines()
    values = {**json.loads(lines[1]), "famly": "geometry"}
    store.path.write_text(f"{lines[0]}\n{json.dumps(values)}\n")
    with pytest.raises(ReportError, match=r"line 2: .*famly.*Did you mean 'family'"):
        read_pairs(store.path)


def test_a_second_run_line_is_refused(tmp_path: Path, run: Run) -> None:
    PairStore(tmp_path, run).close()
    path = tmp_path / "pairs.jsonl"
    path.write_text(path.read_text() * 2)
    with pytest.raises(ReportError, match="the run is the first line and the first line only"):
        read_pairs(path)


def test_a_missing_file_says_where_it_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match=r"Cannot read .*pairs\.jsonl"):
        read_pairs(tmp_path)


def test_packed_pairs_are_read_where_there_are_no_others(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, False))
    store.close()
    plain = read_pairs(tmp_path)
    packed = tmp_path / "pairs.jsonl.gz"
    packed.write_bytes(gzip.compress(store.path.read_bytes(), mtime=0))
    store.path.unlink()
    assert read_pairs(tmp_path) == read_pairs(packed) == plain
    packed.write_bytes(packed.read_bytes()[:-20])
    with pytest.raises(ReportError, match=r"Cannot read .*pairs\.jsonl\.gz"):
        read_pairs(tmp_path)


def test_an_earlier_run_is_kept(tmp_path: Path, run: Run) -> None:
    first = PairStore(tmp_path, run)
    first.append(record_of(run.planned[0], True, True))
    first.close()
    before = first.path.read_bytes()
    second = PairStore(tmp_path, run)
    assert first.path.read_bytes() == before, "nothing is touched before the first pair arrives"
    second.close()
    assert (tmp_path / "pairs.1.jsonl").read_bytes() == before
    assert read_pairs(tmp_path).records == ()


def test_resuming_continues_behind_a_torn_line(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    for pair in run.planned[:3]:
        store.append(record_of(pair, True, True))
    store.close()
    os.truncate(store.path, store.path.stat().st_size - 10)
    resumed, stored = PairStore.resume(tmp_path, run)
    assert stored is not None
    assert stored.torn
    assert stored.measured == {pair.case_id for pair in run.planned[:2]}
    resumed.append(record_of(run.planned[2], True, False))
    resumed.close()
    after = read_pairs(tmp_path)
    assert not after.torn
    assert [record.case_id for record in after.records] == [pair.case_id for pair in run.planned[:3]]


def test_resuming_nothing_begins_a_run(tmp_path: Path, run: Run) -> None:
    (tmp_path / "pairs.jsonl").write_bytes(b'{"line":"run","sch')
    store, stored = PairStore.resume(tmp_path, run)
    store.close()
    assert stored is None
    assert read_pairs(tmp_path).run == run


def test_resuming_other_cases_or_another_policy_is_refused(tmp_path: Path, run: Run) -> None:
    PairStore(tmp_path, run).close()
    with pytest.raises(ReportError, match=r"other cases \(32 then, 31 now\)"):
        PairStore.resume(tmp_path, Run(run.planned[1:], run.provenance))
    other = {**run.provenance, "policy": {**run.provenance["policy"], "query_interval": 1}}
    with pytest.raises(ReportError, match="another output folder"):
        PairStore.resume(tmp_path, Run(run.planned, other))


def test_a_folder_that_cannot_be_written_is_found_before_playing(tmp_path: Path, run: Run) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OptionError, match="cannot be written to"):
        PairStore(tmp_path / "file" / "out", run)


def test_a_case_is_planned_once(run: Run) -> None:
    with pytest.raises(ReportError, match="planned twice"):
        Run((*run.planned, run.planned[0]), run.provenance)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), b"bytes", object()])
def test_a_pair_that_is_no_json_is_refused_and_harms_no_other(
    tmp_path: Path, run: Run, value: object
) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, True))
    with pytest.raises(ReportError, match=f"{run.planned[1].case_id}.*a value JSON does not know"):
        store.append(record_of(run.planned[1], True, True, evidence={"moved_m": value}))
    store.append(record_of(run.planned[2], True, True))
    store.close()
    assert [record.case_id for record in read_pairs(tmp_path).records] == [
        run.planned[0].case_id,
        run.planned[2].case_id,
    ]


@pytest.mark.parametrize("written", [0, 20])
def test_after_a_failed_write_nothing_is_put_behind_the_damage(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, written: int
) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, True))
    whole = store.path.stat().st_size

    def full(descriptor: int) -> None:
        os.truncate(store.path, whole + written)
        raise OSError("No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(ReportError, match=r"No space left on device\. Is the disk full"):
            store.append(record_of(run.planned[1], True, True))
    with pytest.raises(ReportError, match="an earlier write failed"):
        store.append(record_of(run.planned[2], True, True))
    store.close()
    stored = read_pairs(tmp_path)
    assert stored.torn == (written > 0)
    assert [record.case_id for record in stored.records] == [run.planned[0].case_id]
