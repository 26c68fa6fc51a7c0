from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.errors import DiskError
from pytest_libero_max.evaluation import resource_checks
from pytest_libero_max.evaluation.resource_checks import MIB, memory_note, require_disk_space
from pytest_libero_max.machine import GIB, free_disk_bytes
from pytest_libero_max.substrates.registry import SUBSTRATES
from tests.plugin.test_run import Run


def test_a_disk_without_room_for_the_records_stops_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resource_checks, "free_disk_bytes", lambda folder: 100 * MIB)
    require_disk_space(tmp_path, 1000)
    with pytest.raises(
        DiskError, match=r"^100 MiB are free for .*, but the records and reports of 8000 pairs"
    ):
        require_disk_space(tmp_path, 8000)


def test_room_is_looked_for_where_the_folder_will_be(tmp_path: Path) -> None:
    free = free_disk_bytes(tmp_path / "not" / "yet")
    assert free is not None
    assert free > 0
    assert free_disk_bytes(Path("/proc/self/environ/none")) is None


def test_a_session_without_room_ends_before_it_plays(run: Run, pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        "from pytest_libero_max.evaluation import resource_checks\n"
        "resource_checks.free_disk_bytes = lambda folder: 0\n"
    )
    result = run("--libero-max-limit=1", subprocess=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: 0 MiB are free for *libero-max-results*"])
    assert not (pytester.path / "libero-max-results" / "pairs.jsonl").exists()


def test_too_little_memory_for_the_workers_is_said_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource_checks, "available_bytes", lambda: int(2.5 * GIB))
    assert memory_note(3, SUBSTRATES["embedded"]) is None
    note = memory_note(8, SUBSTRATES["embedded"])
    assert note is not None
    assert "2.5 GiB of memory are free, and 8 workers would take about 6.4 GiB" in note
    assert "without the policy. Play with -n 3," in note
    assert "8 workers would take about 24.8 GiB on the libero substrate" in str(
        memory_note(8, SUBSTRATES["libero"])
    )
    monkeypatch.setattr(resource_checks, "available_bytes", lambda: None)
    assert memory_note(1000, SUBSTRATES["embedded"]) is None
