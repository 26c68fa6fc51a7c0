"""Examinations in other processes, interrupted and resumed."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.certificates import Certificate
from pytest_libero_max.changes import MoveObject
from pytest_libero_max.errors import ManifestError, SubstrateError
from pytest_libero_max.experts import noop
from pytest_libero_max.makers.construction.examiner import (
    Examiner,
    Ledger,
    Progress,
    inputs_digest,
    scene_order,
)
from pytest_libero_max.makers.construction.preflight import Preflight, Problem
from pytest_libero_max.makers.construction.visibility import Sight
from pytest_libero_max.substrates.contract import SubstrateOptions
from pytest_libero_max.substrates.registry import SUBSTRATES
from tests.makers.construction.test_preflight import case_of, insertion, move

NOOP = Path(noop.__file__)
BATCH = SUBSTRATES["tiny"].batch


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    """More than a batch of a tiny world's cases, sensible and not."""
    made = [move(0.06, 0.0), insertion(0.14, 0.0), insertion(0.03, 0.0)]
    return [
        replace(
            made[n % 3], case_id=f"case-{n:02d}", record={**made[n % 3].record, "case_id": f"case-{n:02d}"}
        )
        for n in range(BATCH + 2)
    ]


@pytest.fixture(scope="module")
def examiner(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Examiner]:
    with Examiner(tmp_path_factory.mktemp("whole"), 1, substrate="tiny") as examiner:
        yield examiner


@pytest.fixture(scope="module")
def examined(cases: list[Case], examiner: Examiner) -> dict[str, Preflight]:
    return dict(examiner.examine(cases))


def test_sensible_cases_pass_and_others_do_not(examined: dict[str, Preflight], cases: list[Case]) -> None:
    assert list(examined) == [case.case_id for case in cases]
    for number, examination in enumerate(examined.values()):
        assert examination.passed == (number % 3 != 2)


class Stopped(Exception):
    """Somebody ended the process."""


def test_an_interrupted_examination_goes_on_where_it_stopped(
    examined: dict[str, Preflight], cases: list[Case], tmp_path: Path
) -> None:
    def stop(progress: Progress) -> None:
        if progress.done == BATCH:
            raise Stopped

    with Examiner(tmp_path, 1, stop, substrate="tiny") as examiner, pytest.raises(Stopped):
        examiner.examine(cases)
    with examiner.path().open("a") as file:
        file.write('["torn')
    measured = len(Ledger(examiner.path(), Preflight).found)
    assert BATCH <= measured < len(cases)
    seen: list[Progress] = []
    with Examiner(tmp_path, 1, seen.append, substrate="tiny") as second:
        assert second.path() == examiner.path()
        assert dict(second.examine(cases)) == examined
    assert [progress.done for progress in seen] == list(range(measured, len(cases) + 1))
    assert seen[0].per_minute is None
    assert seen[-1].good == sum(found.passed for found in examined.values())


def test_a_case_that_was_changed_is_examined_again(cases: list[Case], examiner: Examiner) -> None:
    other = insertion(0.03, 0.0)
    record = {**other.record, "case_id": cases[0].case_id}
    changed = replace(other, case_id=cases[0].case_id, record=record)
    assert examiner.examine(cases[:1])[cases[0].case_id].passed
    assert not examiner.examine([changed])[cases[0].case_id].passed


def test_examinations_depend_on_the_expert_and_its_files(tmp_path: Path) -> None:
    adapter = tmp_path / "expert.py"
    adapter.write_text(NOOP.read_text())
    first = inputs_digest(str(adapter), "tiny", None)
    assert inputs_digest(f"{adapter}:policy", "tiny", None) == first
    assert inputs_digest(None, "tiny", None) != first
    adapter.write_text("# A comment.\n" + NOOP.read_text())
    assert inputs_digest(str(adapter), "tiny", None) == first
    (tmp_path / "unrelated.py").write_text("SPEED = 1\n")
    assert inputs_digest(str(adapter), "tiny", None) == first
    (tmp_path / "helper.py").write_text("SPEED = 1\n")
    adapter.write_text(NOOP.read_text() + "\nimport helper\n")
    imported = inputs_digest(str(adapter), "tiny", None)
    assert imported != first
    (tmp_path / "helper.py").write_text("SPEED = 2\n")
    assert inputs_digest(str(adapter), "tiny", None) != imported


def test_an_expert_by_name_does_not_depend_on_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = inputs_digest("expert", "tiny", None)
    (tmp_path / "anything.py").write_text("SPEED = 1\n")
    monkeypatch.chdir(tmp_path)
    assert inputs_digest("expert", "tiny", None) == first
    assert inputs_digest("stale_expert", "tiny", None) != first


def test_examinations_end_with_a_version_of_the_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    first = inputs_digest("expert", "tiny", None)
    monkeypatch.setattr("pytest_libero_max.makers.construction.examiner.RULES_VERSION", 1000)
    assert inputs_digest("expert", "tiny", None) != first


def test_what_was_found_survives_writing_and_reading(cases: list[Case], tmp_path: Path) -> None:
    passed = Preflight((), (Sight("target", "milk_1", (100, 200), (90, 0)),))
    failed = Preflight((Problem("view", "milk_1 has 0, 0 pixels"),))
    certificate = Certificate("unsolved", 12, 90)
    preflights, certificates = tmp_path / "preflights.jsonl", tmp_path / "certificates.jsonl"
    for case, found in zip(cases, (passed, failed), strict=False):
        Ledger(preflights, Preflight).add(case, found)
    Ledger(certificates, Certificate).add(cases[0], certificate)
    assert list(Ledger(preflights, Preflight).found.values()) == [passed, failed]
    assert Ledger(certificates, Certificate).of(cases[0]) == certificate


def test_certificates_are_kept_apart_from_what_decides(cases: list[Case], examiner: Examiner) -> None:
    before = dict(examiner.examine(cases[:2]))
    found = examiner.certify(cases[:2], "noop")
    assert {one.ending for one in found.values()} == {"not_triggered"}
    assert examiner.examine(cases[:2]) == before
    assert examiner.path().parent != examiner.path("noop").parent


def test_what_the_substrate_lacks_is_said_of_each_case(examiner: Examiner) -> None:
    case = case_of("target_relocation", MoveObject("teapot_1", (0.06, 0.0, 0.0)))
    (examination,) = examiner.examine([case]).values()
    (problem,) = examination.problems
    assert problem.check == "substrate"
    assert "teapot_1" in problem.detail


def test_genuine_cases_are_sorted_without_the_packages_own_catalogues() -> None:
    """No catalogue of this package knows the names of the installed LIBERO-Plus."""
    raw = {**case_of("target_relocation", MoveObject("mug_1", (0.06, 0.0, 0.0))).record}
    records = [
        {**raw, "case_id": f"plus-{number}", "substrate_category": "Camera Viewpoints", "task_index": number}
        | {"substrate_difficulty": 1, "task_suite_name": "libero_object", "task_name": "not_of_the_catalogue"}
        for number in (7, 3)
    ]
    cases = [parse_case(record) for record in records]
    with pytest.raises(SubstrateError):
        sorted(cases, key=scene_order("embedded", None))
    order = scene_order("libero", None)
    assert [case.task_index for case in sorted(cases, key=order)] == [3, 7]
    with pytest.raises(SubstrateError):
        sorted(cases, key=scene_order("libero", SubstrateOptions(variations="own")))


def test_variations_of_one_task_are_neighbours() -> None:
    raw = {**case_of("target_relocation", MoveObject("mug_1", (0.06, 0.0, 0.0))).record}
    names = ("open_the_door_view_1_initstate_2", "close_the_door_tb_1", "open_the_door_add_3")
    records = [
        {**raw, "case_id": f"plus-{number}", "task_index": number, "task_name": name}
        | {"substrate_category": "Robot Initial States", "substrate_difficulty": 1}
        for number, name in enumerate(names)
    ]
    found = sorted(map(parse_case, records), key=scene_order("libero", None))
    assert [case.task_index for case in found] == [1, 0, 2]


@pytest.mark.parametrize(
    "line",
    [
        b"5",
        b"[1, 2]",
        b"\xff",
        b"[" * 9999,
        b'[[], "0", {"ending": "solved"}]',
        b'["a", "0", {"x": 1}]',
        b'["a", "0", {"ending": "won"}]',
        b'["a", "0", {"ending": "solved", "steps": "90"}]',
    ],
)
def test_a_damaged_line_of_what_was_found_is_named(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "found"
    path.write_bytes(b'["b", "1", {"ending": "solved", "trigger_step": 3, "steps": 90}]\n' + line + b"\n")
    with pytest.raises(ManifestError, match="found, line 2 "):
        Ledger(path, Certificate)
