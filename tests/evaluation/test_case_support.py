from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_libero_max.benchmark import tracks
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import OptionError
from pytest_libero_max.evaluation.case_support import require_support, supported_cases, supported_track
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import SUBSTRATES

ANY = SubstrateOptions()
OWN = SubstrateOptions(variations="own")


Lacking = Callable[[SubstrateOptions, Sequence[Case]], Mapping[str, str]]


def only_unmodified(options: SubstrateOptions, cases: Sequence[Case]) -> dict[str, str]:
    """A LIBERO without its variations."""
    return {case.case_id: "LIBERO-Plus is not installed" for case in cases if case.source == "plus"}


def lacks(monkeypatch: pytest.MonkeyPatch, lacking: Lacking) -> None:
    """Let the genuine substrate lack something."""
    monkeypatch.setitem(SUBSTRATES._loaded, "libero", replace(SUBSTRATES["libero"], lacking=lacking))


@pytest.fixture
def genuine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of tracks in which ``smoke`` has a version for the genuine scenes: the original one."""
    folder = shutil.copytree(tracks.FOLDER, tmp_path / "tracks", ignore=lambda *_: [tracks.GENUINE])
    (folder / tracks.GENUINE).mkdir()
    tracks.write_frozen(folder / tracks.GENUINE / "smoke.json.gz", load_track("original").to_json())
    tracks.write_checksums(folder / tracks.GENUINE, ["smoke.json.gz"])
    for function in (tracks.track_names, tracks.track_path, tracks.load_track, tracks.name_in):
        monkeypatch.setattr(function, "__defaults__", (folder,))
    monkeypatch.setattr(tracks, "FOLDER", folder)
    return folder


@pytest.mark.parametrize(
    ("name", "substrate", "options", "expected"),
    [
        (None, "embedded", ANY, "smoke"),
        (None, "tiny", ANY, "smoke"),
        ("lite", "embedded", ANY, "lite"),
        (None, "libero", OWN, "smoke"),
        ("smoke", "libero", ANY, "genuine/smoke"),
        ("smoke", "libero", OWN, "smoke"),
        ("lite", "libero", ANY, "lite"),
        ("original", "libero", ANY, "original"),
        ("genuine/smoke", "libero", ANY, "genuine/smoke"),
        (None, "libero", ANY, "genuine/smoke"),
    ],
)
def test_the_track_is_that_of_the_substrate(
    genuine: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str | None,
    substrate: str,
    options: SubstrateOptions,
    expected: str,
) -> None:
    lacks(monkeypatch, only_unmodified)
    assert supported_track(name, substrate, options) == expected


def test_the_default_is_what_any_libero_plays_where_smoke_lacks_something(
    genuine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacks(monkeypatch, lambda options, cases: {case.case_id: "it" for case in cases[:1]})
    assert supported_track(None, "libero", ANY) == "original"


def test_cases_that_cannot_play_are_counted_by_reason_and_the_fitting_tracks_named(
    genuine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacks(monkeypatch, only_unmodified)
    require_support("track original", load_track("original").cases, "libero", ANY)
    with pytest.raises(OptionError) as raised:
        require_support("track lite", load_track("lite").cases, "libero", ANY)
    message = str(raised.value)
    assert "560 of 800 cases" in message
    assert "560: LIBERO-Plus is not" in message
    assert "--libero-max-track=smoke or --libero-max-track=original," in message
    assert "add --libero-max-only-installed to play" in message


def test_what_is_not_installed_can_be_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    lacks(monkeypatch, only_unmodified)
    cases = load_track("lite").cases
    fit = supported_cases("track lite", cases, "libero", ANY)
    assert fit == tuple(case for case in cases if case.source == "pro")
    with pytest.raises(OptionError, match="560 of 560 cases of"):
        supported_cases("track lite", [case for case in cases if case.source == "plus"], "libero", ANY)


def test_the_embedded_scenes_refuse_tasks_of_the_genuine_libero_plus(
    pytester: pytest.Pytester, tmp_path: Path
) -> None:
    document = json.loads(load_track("smoke").to_json())
    for record in document["cases"]:
        if not record["substrate_category"].startswith("LIBERO-PRO/"):
            record["task_name"] += "_table_1"
    manifest = tmp_path / "theirs.json"
    manifest.write_text(json.dumps(document))
    arguments = ("--libero-max-policy=noop", f"--libero-max-manifest={manifest}", "--collect-only", "-q")
    refused = pytester.runpytest_inprocess(*arguments, "-p", "no:cacheprovider")
    assert refused.ret == pytest.ExitCode.USAGE_ERROR
    refused.stderr.fnmatch_lines(
        [
            "*16 of 32 cases of manifest theirs.json cannot be played on substrate embedded.",
            "16: they name tasks of the genuine LIBERO-Plus, which --libero-max-substrate=libero plays.",
            "Play --libero-max-track=smoke, which fits; add --libero-max-only-installed to play the other "
            "16, or choose the pairs yourself with -k or -m.",
        ]
    )
    fit = supported_cases("theirs", load_manifest(manifest).cases, "embedded", ANY)
    assert {case.source for case in fit} == {"pro"}
