from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from pytest_libero_max.benchmark import documents
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


def test_a_file_that_unpacks_to_too_much_or_is_damaged_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.json.gz"
    path.write_bytes(gzip.compress(bytes(5000)))
    assert documents.read_content(path) == bytes(5000)
    monkeypatch.setattr(documents, "MOST_BYTES", 4999)
    with pytest.raises(OSError, match="more than 4999 bytes"):
        documents.read_content(path)
    path.write_bytes(path.read_bytes()[:-4])
    monkeypatch.undo()
    with pytest.raises(OSError, match="ended before"):
        documents.read_content(path)
