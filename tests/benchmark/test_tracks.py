import shutil
from pathlib import Path

import pytest

from pytest_libero_max.benchmark import tracks
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.errors import ManifestError, OptionError


def test_a_track_is_a_manifest_that_exists_and_keeps_its_bytes() -> None:
    assert "smoke" in tracks.track_names()
    for name in tracks.track_names():
        path = tracks.track_path(name)
        assert tracks.load_track(name).to_json().encode() == tracks.content_of(path)
    assert tracks.load_track("smoke") == load_manifest(tracks.track_path("smoke"))


def test_an_unknown_track_is_answered_with_the_closest() -> None:
    with pytest.raises(OptionError, match=r"track='smok' .*'smoke'"):
        tracks.track_path("smok")


def test_a_track_that_was_edited_is_refused(tmp_path: Path) -> None:
    folder = shutil.copytree(tracks.FOLDER, tmp_path / "tracks")
    assert len(tracks.load_track("smoke", folder)) == 32
    path = tracks.track_path("smoke", folder)
    edited = tracks.content_of(path).decode().replace('"init_state_index": 0', '"init_state_index": 1')
    tracks.write_frozen(path, edited)
    with pytest.raises(ManifestError, match="that was frozen"):
        tracks.load_track("smoke", folder)


def test_files_are_written_with_the_same_bytes_every_time(tmp_path: Path) -> None:
    one, other = tmp_path / "one.json.gz", tmp_path / "other.json.gz"
    for path in (one, other):
        tracks.write_frozen(path, "[1, 2]\n")
    assert one.read_bytes() == other.read_bytes()
    assert tracks.content_of(one) == b"[1, 2]\n"


@pytest.mark.parametrize("content", [b"one two three\n", b"\xff\n", b"\n"])
def test_a_damaged_list_of_checksums_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / tracks.CHECKSUMS).write_bytes(content)
    with pytest.raises(ManifestError, match=f"{tracks.CHECKSUMS} is damaged"):
        tracks.read_checksums(tmp_path)
