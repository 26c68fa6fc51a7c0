from __future__ import annotations

from pathlib import Path

import pytest

from pytest_libero_max.benchmark.documents import cut_torn_line, slug


@pytest.mark.parametrize(
    ("content", "whole"),
    [(b"", b""), (b"one\ntwo\n", b"one\ntwo\n"), (b"one\ntw", b"one\n"), (b"on", b"")],
)
def test_a_line_that_a_kill_cut_off_is_removed(tmp_path: Path, content: bytes, whole: bytes) -> None:
    path = tmp_path / "lines.jsonl"
    path.write_bytes(content)
    assert cut_torn_line(path) == (content != whole)
    assert path.read_bytes() == whole


def test_a_slug_is_one_word() -> None:
    assert slug("Camera Viewpoints") == "camera_viewpoints"
