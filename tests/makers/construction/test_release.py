"""The files of the benchmark, and what may not change them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.certificates import CERTIFICATES, Certificate, Ending, read_certificates
from pytest_libero_max.benchmark.tracks import (
    CHECKSUMS,
    FOLDER,
    UNEXAMINED,
    load_track,
    write_checksums,
    write_frozen,
)
from pytest_libero_max.makers.construction.release import FILES, add_certificates, read_unexamined

HEAD = "case_id\tending\ttrigger_step\tsteps\n"


@pytest.fixture
def uncertified(tmp_path: Path) -> Path:
    folder = tmp_path / "tracks"
    shutil.copytree(FOLDER, folder)
    write_frozen(folder / CERTIFICATES, HEAD)
    write_checksums(folder, FILES)
    return folder


def _certified(certificate: Certificate, cases: Sequence[Case]) -> dict[str, Certificate]:
    return {case.case_id: certificate for case in cases}


def test_a_good_expert_and_one_that_always_fails_leave_the_same_tracks(
    uncertified: Path, tmp_path: Path
) -> None:
    endings: tuple[Ending, ...] = ("solved", "not_triggered", "base_unsolved")
    for ending in endings:
        shutil.copytree(uncertified, tmp_path / ending)
        add_certificates(tmp_path / ending, ["original", "smoke"], partial(_certified, Certificate(ending)))
        assert {one.ending for one in read_certificates(tmp_path / ending).values()} == {ending}
    for path in sorted(path for path in uncertified.iterdir() if path.is_file()):
        versions = {(tmp_path / ending / path.name).read_bytes() for ending in endings}
        if path.name in (CERTIFICATES, CHECKSUMS):
            assert len(versions) == len(endings)
        else:
            assert versions == {path.read_bytes()}


def test_cases_with_a_certificate_are_not_played_again(uncertified: Path) -> None:
    asked: list[list[str]] = []

    def certify(cases: Sequence[Case]) -> Mapping[str, Certificate]:
        asked.append([case.case_id for case in cases])
        return {case.case_id: Certificate("solved", 3, 40) for case in cases}

    add_certificates(uncertified, ["smoke"], certify)
    add_certificates(uncertified, ["smoke", "original"], certify)
    assert [len(one) for one in asked] == [32, 32]
    assert not set(asked[0]) & set(asked[1])
    assert read_certificates(uncertified).keys() == {*asked[0], *asked[1]}


def test_cases_that_were_not_examined_are_not_played(uncertified: Path) -> None:
    first, *others = [case.case_id for case in load_track("smoke", uncertified)]
    write_frozen(uncertified / UNEXAMINED, f"case_id\tmissing\n{first}\tits models\n")
    write_checksums(uncertified, [*FILES, UNEXAMINED])
    add_certificates(uncertified, ["smoke"], partial(_certified, Certificate("solved")))
    assert read_certificates(uncertified).keys() == set(others)
    assert read_unexamined(uncertified) == {first: "its models"}
