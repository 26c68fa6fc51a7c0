from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import OptionError, OtherRunError, ReportError
from pytest_libero_max.evaluation.settings import OPTIONS
from pytest_libero_max.pairing.probes.registry import PROBES
from pytest_libero_max.pairing.record import PairError, PairRecord
from pytest_libero_max.policies.wrappers import WRAPPERS
from pytest_libero_max.runs import store as store_module
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.replay_command import replay_of
from pytest_libero_max.runs.store import PairStore, read_pairs, read_to_resume
from tests.report.made_up import POLICY, PROVENANCE, error_of, plan, record_of

MONITORED = pytest.mark.skipif("chunk_change" not in PROBES, reason="the lab, which checks these columns")


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


def test_half_a_character_from_the_command_line_leaves_the_run_readable(tmp_path: Path) -> None:
    for name in ("caf\udce9", "café \U0001f916"):  # an argument that is no UTF-8, and one that is
        store = PairStore(
            tmp_path / name[-1].encode(errors="replace").decode(),
            Run(planned=(), provenance=PROVENANCE | {"command": [name]}),
        )
        store.close()
        expected = name.encode(errors="replace").decode()
        assert read_pairs(store.path).run.provenance["command"] == [expected]


def test_a_line_is_on_disk_before_the_next_pair(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.fstat(descriptor).st_size))
    monkeypatch.setattr(store_module, "SYNC_S", 0.0)
    store = PairStore(tmp_path, run)
    assert not store.path.exists()
    for pair in run.planned[:2]:
        store.append(record_of(pair, True, True))
        assert synced[-1] == store.path.stat().st_size
    assert len(read_pairs(store.path, ended=False).records) == 2
    store.close()


def test_lines_that_come_fast_wait_for_the_disk_together(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(os.fstat(descriptor).st_size))
    monkeypatch.setattr(store_module, "SYNC_S", 1000.0)
    store = PairStore(tmp_path, run)
    for pair in run.planned[:3]:
        store.append(record_of(pair, True, True))
    assert len(synced) == 1
    assert len(read_pairs(store.path, ended=False).records) == 3
    store.close()
    assert synced[1:] == [store.path.stat().st_size]


def test_a_process_that_is_killed_loses_no_line(tmp_path: Path) -> None:
    script = (
        "import os, sys, pathlib; from pytest_libero_max.runs.plan import Run; "
        "from pytest_libero_max.runs.store import PairStore; "
        "from tests.report.made_up import PROVENANCE, plan, record_of; "
        "run = Run(tuple(plan()), PROVENANCE); store = PairStore(pathlib.Path(sys.argv[1]), run); "
        "[store.append(record_of(pair, True, True)) for pair in run.planned[:3]]; os.kill(os.getpid(), 9)"
    )
    assert subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=False).returncode == -9
    assert len(read_pairs(tmp_path / "pairs.jsonl", ended=False).records) == 3


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
    with pytest.raises(ReportError, match=r"pairs\.jsonl, line 2:"):
        read_pairs(store.path)


def test_an_unknown_field_is_an_error_with_its_line(tmp_path: Path, run: Run) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, False))
    store.close()
    lines = store.path.read_text().splitlines()
    values = {**json.loads(lines[1]), "famly": "geometry"}
    store.path.write_text(f"{lines[0]}\n{json.dumps(values)}\n")
    with pytest.raises(ReportError, match=r"line 2: .*famly.*'family'"):
        read_pairs(store.path)


def test_a_second_run_line_is_refused(tmp_path: Path, run: Run) -> None:
    PairStore(tmp_path, run).close()
    path = tmp_path / "pairs.jsonl"
    path.write_text(path.read_text() * 2)
    with pytest.raises(ReportError, match="first line only"):
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
    with pytest.raises(OptionError, match="cannot be written"):
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
    record = structs.replace(record_of(run.planned[1], True, True), timings={"moved_m": value})
    with pytest.raises(ReportError, match=f"{run.planned[1].case_id}.*JSON does not"):
        store.append(record)
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
        patch.setattr(store_module, "SYNC_S", 0.0)
        with pytest.raises(ReportError, match=r"left on device\."):
            store.append(record_of(run.planned[1], True, True))
    with pytest.raises(ReportError, match="earlier write failed"):
        store.append(record_of(run.planned[2], True, True))
    store.close()
    stored = read_pairs(tmp_path)
    assert stored.torn == (written > 0)
    assert [record.case_id for record in stored.records] == [run.planned[0].case_id]


def _copies(folder: Path, run: Run, change: Callable[[Json], object]) -> Path:
    """A run of two pairs, the second of which has been changed by hand."""
    store = PairStore(folder, run)
    for pair in run.planned[:2]:
        store.append(record_of(pair, True, False))
    store.close()
    lines = store.path.read_text().splitlines()
    values = json.loads(lines[2])
    change(values)
    store.path.write_text("\n".join([*lines[:2], json.dumps(values)]) + "\n")
    return store.path


def _base(values: Json) -> Json:
    base: Json = values["arms"]["base"]
    return base


def _dynamic(values: Json) -> Json:
    dynamic: Json = values["arms"]["dynamic"]
    return dynamic


def _evidence(values: Json) -> Json:
    evidence: Json = _dynamic(values)["firings"][0]["evidence"]
    return evidence


def _nested(levels: int) -> Any:
    return [_nested(levels - 1)] if levels else 1


def _motion(values: Json, **columns: object) -> None:
    motion = {"path_m": 1.0, "jerk_m_s3": None, "step_m": [0.1], "step_jerk_m_s3": []}
    _base(values)["probes"] = {"motion": motion | columns}


def _watched(values: Json, steps: list[int], scores: list[float]) -> None:
    _base(values)["probes"] = {"chunk_change": {"step": steps, "score": scores}}


def _never_triggered(values: Json) -> None:
    _dynamic(values).update(firings=[], response_step=None, stale_actions=None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda values: values.update(max_steps="220"),
            "max_steps='220', but must",
        ),
        (lambda values: values.update(variant=True), "variant=True, but must be 0 or 1"),
        (lambda values: _base(values).update(success=1), "arms.base.success=1, but must be true or false"),
        (lambda values: _base(values).update(steps=None), "arms.base.steps=None, but must be"),
        (lambda values: _base(values).update(steps=221), "steps=221 of arm 'base', but max_steps=220"),
        (_never_triggered, "the event never came, but Base and Dynamic differ"),
        (lambda values: _dynamic(values).update(response_step=22), "a response comes after the event"),
        (lambda values: _dynamic(values).update(stale_actions=3), "stale_actions=3, but 2 actions"),
        (lambda values: _dynamic(values).update(firings=[]), "of an arm in which nothing happened"),
        (lambda values: _base(values).update(steps=22), "the event came after 23 steps"),
        (
            lambda values: _dynamic(values).update(shares="base"),
            "'dynamic' differs from 'base', which",
        ),
        (lambda values: values.update(event="camera_shift"), "event='camera_shift' .* planned was 'illumin"),
        (lambda values: values.update(source="libero"), "source='libero' .* planned was 'plus'"),
        (lambda values: values.update(case_id="another"), "case_id='another' was played but not planned"),
        (lambda values: values["policy"].update(revision="b"), "policy.revision: None, 'b'"),
        (
            lambda values: values["policy"].update(horizon=0),
            "record: horizon=0, .* at least 1",
        ),
        (lambda values: values["policy"].update(query_interval=11), "query_interval=11 .* horizon=10"),
        (lambda values: values["policy"].update(suites=["libero_10"]), "suite='libero_spatial', but"),
        (lambda values: values["policy"].update(cameras="agentview"), "cameras='agentview', but"),
        (lambda values: values["timings"].update(pair_s="1.25"), "timings.pair_s='1.25', but must be"),
        (lambda values: values["timings"].update(query_ms={"base": {"x": 1}}), "timings.query_ms=.* in what"),
        (lambda values: values["timings"].update(query_ms=1.5), "query_ms=1.5, but must be"),
        (lambda values: values["arms"].pop("dynamic"), "a pair has 'dynamic' as well"),
        (lambda values: _base(values).update(queries=92), "queries=92.* of an arm of 90 steps"),
        (lambda values: _base(values).update(returned=[3, 2]), "returned=.3, 2. of an arm"),
        (
            lambda values: _evidence(values).update(before={"position_m": {"a": [1, 2]}}),
            "position_m.a=.1, 2.",
        ),
        (lambda values: _evidence(values).update(deep=_nested(9)), "evidence.deep=.* at most 8 levels"),
        (lambda values: _evidence(values).update(large=2**63), "evidence.large=9223372036854775808"),
        (
            lambda values: _base(values).update(probes={"mine": {"a": {"b": 1}}}),
            "probes.mine=.* in what must",
        ),
        (lambda values: _base(values).update(probes={"stages": {"goal": []}}), "'stages': .* entity is miss"),
        (lambda values: _motion(values, step_m=["x"]), "probe 'motion': step_m='x', but must be finite"),
        (lambda values: _motion(values, path_m=-1.0), "probe 'motion': path_m=-1.0, .* at least 0"),
        (lambda values: _motion(values, pathm=1.0), "probe 'motion': the unknown column 'pathm'"),
        pytest.param(
            lambda values: _watched(values, [5, 10], [0.5]),
            "score has 1 value, but must have one for each",
            marks=MONITORED,
        ),
        pytest.param(
            lambda values: _watched(values, [5, 91], [0.5, 1.0]),
            "step 91, but the arm took 90 steps",
            marks=MONITORED,
        ),
        (lambda values: values["fingerprints"].update(mujoco="3.4"), "fingerprints.mujoco: None, '3.4'"),
    ],
)
def test_a_record_that_contradicts_itself_or_its_run_is_refused_with_its_line(
    tmp_path: Path, run: Run, change: Callable[[Json], object], message: str
) -> None:
    path = _copies(tmp_path, run, change)
    with pytest.raises(ReportError, match=rf"pairs\.jsonl, line 3: .*{message}"):
        read_pairs(path)


STOP: Json = {"line": "stopped", "reason": "3 regressions", "of": 32, "rule": "errors:3", "at": 3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rule": "luck:3"}, "rule='luck:3' of a stop is no rule"),
        ({"rule": None}, "rule=None and at=3"),
        ({"at": None}, "rule='errors:3' and at=None"),
        ({"at": 33}, "at=33 of a stop, but of=32"),
        ({"of": 31}, "of=31, but the run has 32"),
        ({"rule": "errors\n"}, "must be NAME or NAME:ARGUMENTS"),
    ],
)
def test_a_stop_that_cannot_be_is_refused_with_its_line(
    tmp_path: Path, run: Run, change: Json, message: str
) -> None:
    path = _copies(tmp_path, run, lambda values: None)
    sound = path.read_text()
    path.write_text(f"{sound}{json.dumps(STOP)}\n")
    stopped = read_pairs(path).stopped
    assert stopped is not None
    assert stopped.at == 3
    path.write_text(f"{sound}{json.dumps(STOP | change)}\n")
    with pytest.raises(ReportError, match=rf"pairs\.jsonl, line 4: .*{message}"):
        read_pairs(path)
    resumed = read_to_resume(tmp_path)
    assert resumed is not None
    assert [line.number for line in resumed.damaged] == [4]
    assert len(resumed.records) == 2


def test_a_rule_that_the_run_declared_need_not_be_installed(tmp_path: Path, run: Run) -> None:
    declared = Run(run.planned, run.provenance | {"stopping_rule": "luck:3"})
    path = _copies(tmp_path, declared, lambda values: None)
    path.write_text(f"{path.read_text()}{json.dumps(STOP | {'rule': 'luck:3'})}\n")
    stopped = read_pairs(path).stopped
    assert stopped is not None
    assert stopped.rule == "luck:3"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"versions": {"mujoco": 3}}, "provenance: versions.mujoco=3"),
        ({"scores": {"note": None}}, "lacks comparable_with_published"),
        ({"started": "yesterday"}, "started='yesterday', but must be a time"),
        ({"started": "2026-13-25T10:00:00+00:00"}, "started='2026-13-25.* is no time"),
        ({"substrate": {"name": "embedded", "roots": "/opt"}}, "provenance: substrate.roots='/opt'"),
        (
            {"case_set": {"name": "track smoke", "digest": "0", "path": 3}},
            "provenance: case_set.path=3",
        ),
        ({"platform": {"cores": 2**63}}, "provenance.platform.cores=9223372036854775808"),
        ({"platform": {"deep": _nested(20)}}, "too many lists and objects in each other"),
    ],
)
def test_a_first_line_that_cannot_be_is_refused(tmp_path: Path, run: Run, change: Json, message: str) -> None:
    path = _copies(tmp_path, Run(run.planned, run.provenance | change), lambda values: None)
    with pytest.raises(ReportError, match=rf"pairs\.jsonl, line 1: .*{message}"):
        read_pairs(path)


def test_columns_of_other_packages_are_kept_as_they_are(tmp_path: Path, run: Run) -> None:
    columns = {"height_m": 0.25, "touched": ["a", None, True], "steps": []}
    path = _copies(tmp_path, run, lambda values: _base(values).update(probes={"mine": columns}))
    assert read_pairs(path).records[1].arms["base"].probes == {"mine": columns}


def test_what_draws_and_the_kind_of_processor_may_differ(tmp_path: Path, run: Run) -> None:
    path = _copies(tmp_path, run, lambda values: values["fingerprints"].update(blas="Zen", gl="osmesa"))
    assert len(read_pairs(path).records) == 2


def test_a_case_with_two_records_is_refused_with_both_lines(tmp_path: Path, run: Run) -> None:
    path = _copies(tmp_path, run, lambda values: None)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines, lines[1]]))
    with pytest.raises(ReportError, match=r"measured before \(line 2\)"):
        read_pairs(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"versions": {**PROVENANCE["versions"], "mujoco": "3.2"}}, "fingerprints.mujoco='3.3'.*says '3.2'"),
        ({"policy": {**PROVENANCE["policy"], "code": "a"}}, "fingerprints.adapter='b'.*says 'a'"),
        ({"policy": {**PROVENANCE["policy"], "horizon": 4}}, "policy.horizon=10.*says 4"),
        ({"substrate": {"name": "tiny"}}, "fingerprints.substrate='embedded'.*says 'tiny'"),
    ],
)
def test_records_agree_with_the_header(tmp_path: Path, run: Run, header: Json, message: str) -> None:
    store = PairStore(tmp_path, Run(run.planned, {**PROVENANCE, **header}))
    prints = {"substrate": "embedded", "mujoco": "3.3", "adapter": "b"}
    with pytest.raises(OtherRunError, match=message):
        store.append(record_of(run.planned[0], True, True, fingerprints=prints))
    store.close()


ABSENT = {"flicker": "low"}
"""A wrapper of a package that is not installed."""


@pytest.mark.parametrize(
    ("header", "words", "message"),
    [
        ({}, [], None),
        ({}, ["mine=1"], None),  # an adapter's own
        ({"wrap": {"restore": "gated"}}, ["mine=1", "restore=gated"], None),
        ({"restore": "gated"}, ["restore=gated"], None),  # of an earlier run
        ({"wrap": ABSENT, "horizon": 30}, ["flicker=low H=30 Q=2"], None),
        ({"code": "outside"}, ["restore=gated"], None),
        ({}, ["restore=gated"], r"policy\.wrap=.*'gated'.* says None"),
        ({"wrap": {"restore": "gated"}}, [], r"policy\.wrap=None.* says .*'gated'"),
        ({"restore": "always"}, ["restore=gated"], r"policy\.wrap=.*'gated'.* says .*'always'"),
        ({"wrap": ABSENT}, [], r"policy\.wrap=None.* says .*'low'"),
    ],
)
def test_wrappers_of_records_are_those_of_the_header_installed_or_not(
    tmp_path: Path,
    run: Run,
    header: Json,
    words: list[str],
    message: str | None,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(WRAPPERS, "_loaders", {"restore": lambda: None})
    provenance = {**PROVENANCE, "policy": {**PROVENANCE["policy"], **header}}
    asked = Run.from_dict({**run.to_dict(), "provenance": provenance})
    policy = {**POLICY, **({"wrappers": words} if words else {})}
    store = PairStore(tmp_path, asked)
    with nullcontext() if message is None else pytest.raises(OtherRunError, match=message):
        store.append(record_of(run.planned[0], True, True, policy=policy))
    store.close()


def test_a_replay_names_a_wrapper_that_is_not_installed() -> None:
    policy = {**PROVENANCE["policy"], "wrap": {"restore": "gated", **ABSENT}}
    command = replay_of({**PROVENANCE, "policy": policy})
    assert "--libero-max-wrap=restore:gated,flicker:low" in command
    with pytest.raises(OptionError, match=r"flicker .*another package"):
        next(option for option in OPTIONS if option.name == "wrap").read("flicker:low", "wrap")


DIFFERENCES: list[tuple[Json, str]] = [
    ({"policy": {**PROVENANCE["policy"], "code": "b"}}, "policy.code: None, 'b'"),
    ({"versions": {**PROVENANCE["versions"], "numpy": "2.4"}}, "versions.numpy: None, '2.4'"),
    ({"substrate": {"name": "embedded", "semantics": "corrected"}}, "substrate.semantics: None, 'corrected'"),
    (
        {"substrate": {"name": "embedded", "instruction_source": "clean"}},
        "substrate.instruction_source: ",
    ),
    ({"protocol": {"prefix": "replay"}}, "protocol.prefix: 'fork', 'replay'"),
    ({"case_set": {**PROVENANCE["case_set"], "digest": "1"}}, "case_set.digest: "),
]


@pytest.mark.parametrize(("header", "message"), DIFFERENCES)
def test_resuming_with_something_else_names_the_difference(
    tmp_path: Path, run: Run, header: Json, message: str
) -> None:
    PairStore(tmp_path, run).close()
    with pytest.raises(ReportError, match=f"{message}.*another output folder"):
        PairStore.resume(tmp_path, Run(run.planned, {**PROVENANCE, **header}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": {**POLICY, "revision": "b"}}, "policy.revision: None, 'b'"),
        ({"fingerprints": {"substrate": "embedded", "blas_threads": "2"}}, "blas_threads: None, '2'"),
        ({"fingerprints": {"substrate": "embedded", "assets": "1"}}, "fingerprints.assets: None, '1'"),
    ],
)
def test_pairs_of_a_resumed_run_are_played_like_the_others(
    tmp_path: Path, run: Run, changes: Json, message: str
) -> None:
    store = PairStore(tmp_path, run)
    store.append(record_of(run.planned[0], True, True))
    store.close()
    resumed, _ = PairStore.resume(tmp_path, run)
    with pytest.raises(OtherRunError, match=message):
        resumed.append(record_of(run.planned[1], True, True, **changes))
    resumed.close()
    assert len(read_pairs(tmp_path).records) == 1


@pytest.mark.parametrize("kind", ["RefusalError", "ActionError"])
def test_a_pair_that_was_refused_stays_refused(tmp_path: Path, run: Run, kind: str) -> None:
    refused, fault, measured = run.planned[:3]
    store = PairStore(tmp_path, run)
    store.append(structs.replace(error_of(refused), kind=kind))
    store.append(error_of(fault))
    store.append(record_of(measured, True, True))
    with pytest.raises(ReportError, match=r"before .* stays refused"):
        store.append(record_of(refused, True, True))
    store.close()
    again, stored = PairStore.resume(tmp_path, run)
    assert stored is not None
    assert stored.settled == {refused.case_id, measured.case_id}
    again.begin()
    again.append(record_of(fault, True, True))
    with pytest.raises(ReportError, match="begin a new run"):
        again.append(record_of(refused, True, True))
    again.close()
    assert [error.case_id for error in read_pairs(tmp_path).refused] == [refused.case_id]
