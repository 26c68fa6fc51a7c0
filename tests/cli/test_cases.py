from __future__ import annotations

import json

import pytest

from pytest_libero_max.cli import main


def test_a_track_and_a_case_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "cases", "smoke"]) == 0
    assert "| target_relocation, variant 1 | 2 |" in capsys.readouterr().out
    assert main(["list", "cases", "smoke", "--json"]) == 0
    manifest = json.loads(capsys.readouterr().out)
    case_id = manifest["cases"][0]["case_id"]
    assert main(["list", "cases", "smoke", case_id]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"{case_id}: ")
    assert '"dynamic_phase": "pre_grasp_proximity"' in shown


def test_a_case_that_is_not_there_is_answered_with_the_closest(capsys: pytest.CaptureFixture[str]) -> None:
    for track in ("smoke", "max"):
        assert main(["list", "cases", track, "libero-object-t00-i00-nothing-d0-p195"]) == 1
        error = capsys.readouterr().err
        assert error.startswith(
            "libero-max: case='libero-object-t00-i00-nothing-d0-p195' is not in libero-max-"
        )
        assert "Did you mean '" in error
        assert len(error) < 2500


def test_all_tracks_are_shown_and_verified(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "tracks"]) == 0
    overview = capsys.readouterr().out
    assert "| max | 8000 | 5600 | 2400 | 0 | 8 |" in overview
