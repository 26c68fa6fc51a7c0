import shutil
from pathlib import Path

import pytest

from pytest_libero_max.cases import load_manifest
from pytest_libero_max.construction import tracks
from pytest_libero_max.errors import ManifestError, OptionError


def test_a_track_is_a_manifest_that_exists() -> None:
    assert "smoke" in tracks.track_names()
    for name in tracks.track_names():
        assert tracks.load_track(name) == load_manifest(tracks.track_path(name))


def test_an_unknown_track_is_answered_with_the_closest() -> None:
    with pytest.raises(OptionError, match=r"track='smok' is not a track\. Did you mean 'smoke'"):
        tracks.track_path("smok")


def test_a_track_that_was_edited_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(tracks.FOLDER, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(tracks, "FOLDER", tmp_path)
    assert len(tracks.load_track("smoke")) == 32
    path = tmp_path / "smoke.json"
    path.write_text(path.read_text().replace('"init_state_index": 0', '"init_state_index": 1'))
    with pytest.raises(ManifestError, match="the content is not the one that was frozen"):
        tracks.load_track("smoke")
