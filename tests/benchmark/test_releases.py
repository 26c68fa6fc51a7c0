from __future__ import annotations

import gzip
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_libero_max.benchmark import releases
from pytest_libero_max.benchmark.manifests import load_manifest
from pytest_libero_max.benchmark.releases import RELEASED, Recognition, recognise
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import ManifestError


def write_manifest(path: Path, **changes: object) -> bytes:
    """A manifest of one case under another name."""
    document = json.loads(replace(load_track("smoke"), cases=load_track("smoke").cases[:1]).to_json())
    content = (json.dumps({**document, **changes}, indent=2, sort_keys=True) + "\n").encode()
    path.write_bytes(gzip.compress(content) if path.suffix == ".gz" else content)
    return content


def test_the_register_names_each_file_once() -> None:
    assert len({released.sha256 for released in RELEASED}) == len(RELEASED)
    assert all(len(released.sha256) == 64 for released in RELEASED)
    assert str(RELEASED[0]) == "the authors' libero_max_8000.json 3.0.0"
    assert RELEASED[0].cases == 8000


@pytest.mark.parametrize("name", ["anything.json", "anything.json.gz"])
def test_a_released_file_is_known_by_its_bytes(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = write_manifest(tmp_path / name)
    known = replace(RELEASED[2], sha256=hashlib.sha256(content).hexdigest())
    monkeypatch.setattr(releases, "RELEASED", (known, *RELEASED))
    recognition = load_manifest(tmp_path / name).recognition
    assert recognition == Recognition(known, identical=True)
    assert str(recognition) == "the authors' libero_max_pro_model_comparison_800.json 3.0.0"


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("libero_max_8000.json", {}),
        ("libero_max_8000.json.gz", {}),
        ("mine.json", {"benchmark_id": "libero-max-8000"}),
    ],
)
def test_a_file_that_looks_like_a_released_one_and_differs_says_so(
    name: str, changes: dict[str, str], tmp_path: Path
) -> None:
    write_manifest(tmp_path / name, **changes)
    recognition = load_manifest(tmp_path / name).recognition
    assert recognition == Recognition(RELEASED[0], identical=False)
    assert "NOT that file" in str(recognition)


def test_the_packages_own_tracks_claim_nothing(tmp_path: Path) -> None:
    assert load_track("smoke").recognition is None
    assert recognise(b"", tmp_path / "x.json") is None


def test_a_released_file_is_named_in_the_refusal(tmp_path: Path) -> None:
    protocol = {**load_track("smoke").protocol, "scoring_track": "intent_response"}
    write_manifest(tmp_path / "pairs.json", benchmark_id="libero-max-intent-96", protocol=protocol)
    with pytest.raises(ManifestError, match=r"authors' intent_96.json 3.0.0.*case"):
        load_manifest(tmp_path / "pairs.json")


@pytest.mark.parametrize("benchmark_id", ["libero-max-v1-core", "libero-max-v1-intent-core"])
def test_version_1_is_refused_in_one_sentence(benchmark_id: str, tmp_path: Path) -> None:
    write_manifest(tmp_path / "mine.json", benchmark_id=benchmark_id, benchmark_version="1.0.0")
    with pytest.raises(ManifestError, match=r"1\.0\.0 is not played\."):
        load_manifest(tmp_path / "mine.json")


def test_a_file_of_ones_own_may_be_called_like_one_of_version_1(tmp_path: Path) -> None:
    write_manifest(tmp_path / "core.json", benchmark_id="mine")
    assert len(load_manifest(tmp_path / "core.json")) == 1
