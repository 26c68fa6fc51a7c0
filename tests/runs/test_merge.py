from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.selection import Selection
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.exit_status import ended_as_declared
from pytest_libero_max.report.run_texts import title_text
from pytest_libero_max.report.writers.report_files import report_json, report_of
from pytest_libero_max.report.writers.summary import summary_lines
from pytest_libero_max.runs.merge import merge_folders, merge_runs
from pytest_libero_max.runs.plan import PlannedPair, Run
from pytest_libero_max.runs.stopped import Stopped
from pytest_libero_max.runs.store import PairStore, StoredRun, read_pairs
from tests.report.made_up import POLICY, PROVENANCE, error_of, plan, record_of, records_of

PAIRS = plan()
RECORDS = {record.case_id: record for record in records_of(PAIRS)}


def _piece(
    pairs: list[PlannedPair], provenance: Json = PROVENANCE, planned: list[PlannedPair] = PAIRS
) -> StoredRun:
    return StoredRun(
        Run(tuple(planned), provenance), tuple(RECORDS[pair.case_id] for pair in pairs), (), torn=False
    )


def _report(run: StoredRun) -> str:
    return report_json(report_of(run))


@settings(deadline=None, max_examples=15)
@given(st.lists(st.integers(0, 2), min_size=32, max_size=32), st.permutations([0, 1, 2]))
def test_shards_are_the_whole_however_they_are_divided(shard_of: list[int], order: list[int]) -> None:
    shards = [
        _piece([pair for pair, shard in zip(PAIRS, shard_of, strict=True) if shard == number])
        for number in range(3)
    ]
    merged = merge_runs({str(number): shards[number] for number in order})
    assert merged == merge_runs({"a": _piece(PAIRS[:9]), "b": _piece(PAIRS[9:])})


def test_shards_that_planned_their_own_cases_plan_them_all_together() -> None:
    first, second = PAIRS[:10], PAIRS[10:]
    merged = merge_runs({"a": _piece(first, planned=first), "b": _piece(second, planned=second)})
    assert len(merged.run.planned) == 32
    assert _report(merged) == _report(_piece(PAIRS))


def test_an_error_repaired_in_another_run_is_gone() -> None:
    failed = StoredRun(
        Run(tuple(PAIRS), PROVENANCE), (), tuple(error_of(pair) for pair in PAIRS[:2]), torn=False
    )
    merged = merge_runs({"a": failed, "b": _piece(PAIRS[1:])})
    assert [error.case_id for error in merged.errors] == [PAIRS[0].case_id]
    assert len(merged.records) == 31


def test_a_pair_that_one_run_refused_is_not_measured_by_another() -> None:
    pairs = plan()
    refused = structs.replace(error_of(pairs[0]), kind="RefusalError")
    pieces = {
        "a": StoredRun(Run(tuple(pairs), PROVENANCE), (), (refused,), torn=False),
        "b": StoredRun(Run(tuple(pairs), PROVENANCE), (record_of(pairs[0], True, True),), (), torn=False),
    }
    merged = merge_runs(pieces)
    assert (merged.records, merged.errors) == ((), (refused,))
    assert merge_runs(dict(reversed(pieces.items()))) == merged


def test_what_the_pieces_differ_in_is_not_claimed() -> None:
    other = {**PROVENANCE, "command": ["pytest", "--shard=2"], "gl_backend": "osmesa"}
    pieces = {"a": _piece(PAIRS[:5]), "b": _piece(PAIRS[5:], other)}
    for names in permutations(pieces):
        merged = merge_runs({name: pieces[name] for name in names})
        assert merged.run.provenance == {**PROVENANCE, "command": [], "gl_backend": None}


def test_a_merged_run_began_with_the_first_of_its_pieces() -> None:
    dates = ("2026-05-02T10:00:00+00:00", "2026-05-01T23:00:00+00:00")
    pieces = {
        "a": _piece(PAIRS[:5], {**PROVENANCE, "started": dates[0]}),
        "b": _piece(PAIRS[5:], {**PROVENANCE, "started": dates[1]}),
    }
    for names in permutations(pieces):
        assert merge_runs({name: pieces[name] for name in names}).run.provenance["started"] == dates[1]


@pytest.mark.parametrize("key", ["policy", "substrate", "case_set", "protocol", "versions"])
def test_pieces_of_different_measurements_are_refused(key: str) -> None:
    other = {**PROVENANCE, key: {**PROVENANCE[key], "name": "another"}}
    with pytest.raises(ReportError, match=rf"'b' and 'a' .*: {key}\.name: 'another', .*Compare them"):
        merge_runs({"a": _piece(PAIRS[:5]), "b": _piece(PAIRS[5:], other)})


def test_a_pair_measured_in_two_runs_is_refused() -> None:
    with pytest.raises(ReportError, match="in 'a' and in 'b'"):
        merge_runs({"a": _piece(PAIRS[:5]), "b": _piece(PAIRS[4:])})


def test_other_cases_of_one_name_and_single_runs_are_refused() -> None:
    others = [PlannedPair(**{**structs.asdict(pair), "case_digest": "0" * 64}) for pair in PAIRS]
    with pytest.raises(ReportError, match="another case"):
        merge_runs({"a": _piece(PAIRS[:5]), "b": _piece([], planned=others)})
    with pytest.raises(ReportError, match="two or more"):
        merge_runs({"a": _piece(PAIRS)})


def test_merged_folders_are_a_run(tmp_path: Path) -> None:
    for name, pairs in (("a", PAIRS[:5]), ("b", PAIRS[5:])):
        store = PairStore(tmp_path / name, Run(tuple(PAIRS), PROVENANCE))
        for pair in pairs:
            store.append(RECORDS[pair.case_id])
        store.close()
    merged = merge_folders([tmp_path / "b", tmp_path / "a" / "pairs.jsonl"], tmp_path / "whole")
    assert read_pairs(tmp_path / "whole") == merged
    assert _report(merged) == _report(_piece(PAIRS))


def _shard(number: int, of: int = 2) -> StoredRun:
    pairs = PAIRS[32 * (number - 1) // of : 32 * number // of]
    selection = Selection.choose((pair.case_id for pair in pairs), 32, (), (number, of))
    return _piece(pairs, {**PROVENANCE, "selection": selection.to_dict()}, pairs)


def test_all_shards_are_the_whole_track() -> None:
    report = report_of(merge_runs({"a": _shard(1), "b": _shard(2)}))
    assert report.selection is not None
    assert report.selection.whole
    assert report.pairs.complete
    assert title_text(report).endswith("all 32 cases")


def test_a_merge_without_one_shard_is_incomplete_and_names_it() -> None:
    report = report_of(merge_runs({"a": _shard(1, 3), "b": _shard(3, 3)}))
    assert not report.pairs.complete
    assert report.headline.status == "withheld"
    assert "shard 2/3 not among" in (report.headline.reason or "")
    assert report.selection is not None
    assert report.selection.missing_shards == report.pairs.missing_shards == ["2/3"]
    assert summary_lines(report)[0].startswith("INCOMPLETE: 21 of 21 ")
    assert "(selection: shards 1, 3 of 3)" in title_text(report)


def test_a_shard_alone_is_complete_and_says_that_it_is_a_shard() -> None:
    report = report_of(_shard(1))
    assert report.pairs.complete
    assert report.selection is not None
    assert not report.selection.whole
    assert "(selection: shard 1 of 2)" in title_text(report)


def test_a_run_of_an_older_version_claims_nothing_of_the_track() -> None:
    report = report_of(_piece(PAIRS))
    assert report.selection is None
    assert title_text(report).endswith("(selection not recorded)")
    assert report_of(merge_runs({"a": _shard(1), "b": _piece(PAIRS[16:])})).selection is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": {**POLICY, "revision": "b"}}, "policy.revision"),
        ({"fingerprints": {"substrate": "embedded", "blas_threads": "2"}}, "fingerprints.blas_threads"),
        ({"fingerprints": {"substrate": "embedded", "plus": "other assets"}}, "fingerprints.plus"),
    ],
)
def test_pieces_that_were_played_with_different_things_are_refused(changes: Json, message: str) -> None:
    record = record_of(PAIRS[5], True, True, **changes)
    other = StoredRun(Run(tuple(PAIRS), PROVENANCE), (record,), (), torn=False)
    with pytest.raises(ReportError, match=f"with different things: {message}"):
        merge_runs({"a": _piece(PAIRS[:5]), "b": other})


def test_a_merge_says_which_runs_had_stopped() -> None:
    stopped = Stopped("the verdict of the gate is known", 16, "certain", 4)
    first = replace(_piece(PAIRS[:4], planned=PAIRS[:16]), stopped=stopped)
    for names in ("ab", "ba"):
        pieces = {"a": first, "b": _piece(PAIRS[16:], planned=PAIRS[16:])}
        report = report_of(merge_runs({name: pieces[name] for name in names}))
        said = "Stopped: a was stopped by rule certain at pair 4 of 16: the verdict of the gate is known."
        assert summary_lines(report)[0].endswith(f"12 missing. No score. {said}")
        assert not ended_as_declared(report.pairs)
    whole = report_of(merge_runs({"a": first, "b": _piece(PAIRS[4:])}))
    assert whole.pairs.complete
    assert whole.pairs.stopped is None
