from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pytest_libero_max.errors import DiskError, OptionError, ReportError
from pytest_libero_max.report.comparison.compare import compare_runs, read_runs
from pytest_libero_max.report.gate_results import decide
from pytest_libero_max.report.writers.report_files import read_report, write_reports
from pytest_libero_max.runs.lock import MARK_NAME, require_ended, require_free
from pytest_libero_max.runs.merge import merge_folders
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, read_pairs
from tests.report.made_up import PROVENANCE, kill, plan, record_of

RUN = Run(tuple(plan()[:4]), PROVENANCE)


def _played(folder: Path, pairs: int = 4) -> PairStore:
    store = PairStore(folder, RUN)
    for pair in RUN.planned[:pairs]:
        store.append(record_of(pair, True, False))
    return store


def test_no_reader_takes_a_run_in_progress_or_a_killed_one_for_a_result(tmp_path: Path) -> None:
    folder, other = tmp_path / "run", tmp_path / "other"
    _played(other).close()
    store = _played(folder, 2)
    for state in ("is still in progress", "was killed before it ended"):
        for read in (
            lambda: read_pairs(folder),
            lambda: read_pairs(folder / "pairs.jsonl"),
            lambda: read_report(folder),
            lambda: write_reports(folder),
            lambda: decide((), folder, tmp_path),
            lambda: compare_runs(read_runs([folder, other])),
            lambda: merge_folders([folder, other], tmp_path / "merged"),
        ):
            with pytest.raises(ReportError, match=state):
                read()
        if state == "is still in progress":
            kill(store)
    (folder / MARK_NAME).unlink()
    assert len(read_pairs(folder).records) == 2


def test_a_folder_that_is_let_go_is_as_it_was(tmp_path: Path) -> None:
    new = PairStore(tmp_path, RUN)
    new.begin()
    new.abandon()
    assert not (tmp_path / MARK_NAME).exists()
    kill(_played(tmp_path, 2))
    resumed, _ = PairStore.resume(tmp_path, RUN)
    (tmp_path / "pairs.jsonl").write_bytes(b"")  # another process, meanwhile
    with pytest.raises(OptionError, match="written by another"):
        resumed.begin()
    require_free(tmp_path)
    with pytest.raises(ReportError, match="was killed before"):
        require_ended(tmp_path)


def test_a_run_that_begins_takes_away_the_reports_of_the_one_before(tmp_path: Path) -> None:
    _played(tmp_path).close()
    write_reports(tmp_path)
    store = PairStore(tmp_path, RUN)
    assert (tmp_path / "report.json").exists(), "nothing is touched before the run begins"
    store.begin()
    kill(store)
    assert sorted(path.name for path in tmp_path.iterdir()) == [MARK_NAME, "pairs.1.jsonl", "pairs.jsonl"]


def test_a_killed_run_goes_on(tmp_path: Path) -> None:
    kill(_played(tmp_path, 2))
    store, stored = PairStore.resume(tmp_path, RUN)
    assert stored is not None
    assert len(stored.records) == 2
    for pair in RUN.planned[2:]:
        store.append(record_of(pair, True, True))
    store.close()
    assert len(read_pairs(tmp_path).records) == 4
    assert not (tmp_path / MARK_NAME).exists()


def test_a_second_run_in_a_folder_is_refused(tmp_path: Path) -> None:
    first = _played(tmp_path, 1)
    for begin in (
        lambda: PairStore(tmp_path, RUN),
        lambda: PairStore.resume(tmp_path, RUN),
    ):
        with pytest.raises(OptionError, match=f"in progress .*process {os.getpid()}.*another output"):
            begin()
    first.close()
    two = PairStore(tmp_path, RUN), PairStore(tmp_path, RUN)
    two[0].begin()
    with pytest.raises(OptionError, match="is in progress"):
        two[1].begin()
    two[0].close()


def test_the_lock_goes_with_its_process(tmp_path: Path) -> None:
    code = (
        "import os, sys\n"
        "from pathlib import Path\n"
        "from pytest_libero_max.runs.lock import Mark\n"
        "mark = Mark(Path(sys.argv[1]))\n"
        "os._exit(0)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True)
    assert (tmp_path / MARK_NAME).exists()
    PairStore(tmp_path, RUN).close()
    assert not (tmp_path / MARK_NAME).exists()


def test_a_folder_that_is_removed_stops_the_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    store = _played(folder, 1)
    shutil.rmtree(folder)
    with pytest.raises(DiskError, match="was removed while"):
        store.append(record_of(RUN.planned[1], True, False))
    with pytest.raises(DiskError, match="Cannot write"):
        store.close()
    assert not folder.exists()


def test_a_disk_that_is_full_leaves_neither_mark_nor_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = _played(tmp_path)
    store.close()

    def full(descriptor: int, content: bytes, place: int) -> int:
        raise OSError("No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", full)
        resumed, _ = PairStore.resume(tmp_path, RUN)
        with pytest.raises(DiskError, match="the disk full"):
            resumed.begin()
    assert len(read_pairs(tmp_path).records) == 4
    PairStore.resume(tmp_path, RUN)[0].close()
