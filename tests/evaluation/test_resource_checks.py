from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.machine import GIB, free_disk_bytes
from pytest_libero_max.plugin import controller
from pytest_libero_max.plugin.controller import memory_note
from pytest_libero_max.substrates.registry import SUBSTRATES


def test_room_is_looked_for_where_the_folder_will_be(tmp_path: Path) -> None:
    free = free_disk_bytes(tmp_path / "not" / "yet")
    assert free is not None
    assert free > 0
    assert free_disk_bytes(Path("/proc/self/environ/none")) is None


def test_too_little_memory_for_the_workers_is_said_with_a_cure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(controller, "available_bytes", lambda: int(2.5 * GIB))
    assert memory_note(3, SUBSTRATES["embedded"]) is None
    note = memory_note(8, SUBSTRATES["embedded"])
    assert note is not None
    assert "about 6.4 GiB" in note
    assert "policy. Play with -n 3," in note
    assert "would take about 24.8" in str(memory_note(8, SUBSTRATES["libero"]))
    monkeypatch.setattr(controller, "available_bytes", lambda: None)
    assert memory_note(1000, SUBSTRATES["embedded"]) is None
