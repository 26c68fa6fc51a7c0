"""The frozen tracks as they come with the package, and what is said of tampered copies."""

import json
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.certificates import CERTIFICATES
from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.programs import find_program
from pytest_libero_max.benchmark.tracks import (
    CHECKSUMS,
    FOLDER,
    GENUINE,
    content_of,
    load_track,
    write_checksums,
    write_frozen,
)
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.makers.construction.release import FILES, REJECTED, SIGHTS, write_splits
from pytest_libero_max.makers.construction.splits import SPLITS
from pytest_libero_max.makers.construction.verification import require_identity, verify

Edit = Callable[[Json], None]


@pytest.fixture(scope="module")
def whole() -> Manifest:
    return load_track("max")


def test_the_track_on_genuine_scenes_comes_with_the_package() -> None:
    assert "smoke: one case of each event, variant and source" in verify(FOLDER / GENUINE)
    smoke = load_track(f"{GENUINE}/smoke")
    assert smoke.benchmark_id == "libero-max-genuine-smoke"
    assert smoke.protocol["substrate"] == "LIBERO-Plus and LIBERO-PRO"
    needing_models = {"Background Textures", "Light Conditions"}
    assert not {case.source_category for case in smoke} & needing_models


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    return shutil.copytree(FOLDER, tmp_path / "tracks")


def edit(folder: Path, track: str, change: Edit) -> None:
    """Change a track and give it the checksum it would then have."""
    path = folder / f"{track}.json.gz"
    document = json.loads(content_of(path))
    change(document)
    write_frozen(path, json.dumps(document))
    write_checksums(folder, FILES)


def test_every_program_of_beyond_has_cases_of_all_its_suites_alike() -> None:
    track = load_track("beyond")
    programs: dict[str, Counter[str]] = {}
    for case in track:
        assert case.program is not None
        assert case.fits(find_program(case.program.name))
        assert case.case_id.endswith(f"-{case.program.name}")
        programs.setdefault(case.program.name, Counter())[case.suite] += 1
    assert programs.pop("instruction_switch") == {"libero_goal": 48}
    assert len(programs) == 12
    assert all(len(suites) == 4 and {*suites.values()} == {12} for suites in programs.values())
    plain = {case.case_id.removesuffix(f"-{case.program.name}") for case in track if case.program}
    assert len(plain) == len(track)


def test_the_frozen_tracks_are_right() -> None:
    lines = verify(FOLDER)
    assert any(line.startswith("max: 8000 cases") for line in lines)
    assert any("7 x 16 cells of 50" in line for line in lines)
    assert any("1075, 1137, 1135, 1135, 1118" in line for line in lines)


def test_the_splits_can_be_drawn_again(copied: Path) -> None:
    before = (copied / CHECKSUMS).read_text()
    for name in SPLITS:
        (copied / f"{name}.json.gz").unlink()
    write_splits(copied)
    assert (copied / CHECKSUMS).read_text() == before


def test_a_changed_file_is_found(copied: Path) -> None:
    path = copied / "lite.json.gz"
    write_frozen(path, content_of(path).decode().replace('"policy_seed": 195', '"policy_seed": 196', 1))
    with pytest.raises(ManifestError, match=r"lite\.json\.gz"):
        verify(copied)


def test_a_damaged_file_is_found(copied: Path) -> None:
    path = copied / "max.json.gz"
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(ManifestError, match=r"max\.json\.gz.*damaged"):
        verify(copied)


@pytest.mark.parametrize("name", ["lite.json.gz", REJECTED])
def test_a_missing_file_is_found(copied: Path, name: str) -> None:
    (copied / name).unlink()
    with pytest.raises(ManifestError, match=f"{name.removesuffix('.gz')} is in {CHECKSUMS}, but is missing"):
        verify(copied)


def test_a_file_too_many_is_found(copied: Path) -> None:
    shutil.copy(copied / "lite.json.gz", copied / "mine.json.gz")
    with pytest.raises(ManifestError, match=rf"mine\.json is not in {CHECKSUMS}"):
        verify(copied)


def first_of(document: Json, **wanted: object) -> Json:
    record: Json = next(
        case for case in document["cases"] if all(case[key] == value for key, value in wanted.items())
    )
    return record


def harder(document: Json) -> None:
    document["cases"][0]["scenario"]["severity"] = "low"


def other_difficulty(document: Json) -> None:
    first_of(document, substrate_difficulty=3)["substrate_difficulty"] = 4


def without_one(document: Json) -> None:
    document["cases"].remove(first_of(document, substrate_category="LIBERO-PRO/semantic"))


@pytest.mark.parametrize(
    ("change", "message"), [(harder, "scenario"), (other_difficulty, "of the embedded catalogue")]
)
def test_a_case_that_is_not_what_its_identity_demands_is_found(
    whole: Manifest, change: Edit, message: str
) -> None:
    document = {"cases": [json.loads(json.dumps(case.record)) for case in whole.cases[:400]]}
    change(document)
    (edited,) = [
        record for record, case in zip(document["cases"], whole, strict=False) if record != case.record
    ]
    with pytest.raises(ManifestError, match=message):
        require_identity(parse_case(edited))


def test_a_benchmark_without_a_case_is_found(copied: Path) -> None:
    edit(copied, "max", without_one)
    with pytest.raises(ManifestError, match=r"\(semantic, .*\) has 14 cases"):
        verify(copied)


def test_another_draw_of_lite_is_found(copied: Path, whole: Manifest) -> None:
    lite = {case.case_id for case in load_track("lite")}

    def other(case: Case) -> bool:
        return (case.event.name, case.source) == ("camera_shift", "plus") and case.case_id not in lite

    def swap(document: Json) -> None:
        document["cases"][0] = next(case for case in whole if other(case)).record

    edit(copied, "lite", swap)
    with pytest.raises(ManifestError, match=r"lite: .* stands where"):
        verify(copied)


def test_a_certificate_of_a_case_that_is_in_no_track_is_found(copied: Path) -> None:
    path = copied / CERTIFICATES
    write_frozen(path, content_of(path).decode() + "nobody\tsolved\t12\t90\n")
    write_checksums(copied, FILES)
    with pytest.raises(ManifestError, match=f"case 'nobody' is in {CERTIFICATES}, but in no track"):
        verify(copied)


def test_a_case_of_which_nothing_is_known_that_the_cameras_show_is_found(copied: Path) -> None:
    path = copied / SIGHTS
    head, *lines = content_of(path).decode().splitlines(keepends=True)
    case_id = lines[0].partition("\t")[0]
    write_frozen(path, "".join([head, *(line for line in lines if not line.startswith(f"{case_id}\t"))]))
    write_checksums(copied, FILES)
    with pytest.raises(ManifestError, match=f"case '{case_id}' is in a track or in {SIGHTS}"):
        verify(copied)
