from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from pytest_libero_max.errors import DiskError, LiberoMaxError, OptionError, ReportError
from pytest_libero_max.runs.damaged_lines import DAMAGED_NAME, damage_said
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore, StoredRun, read_pairs
from tests.report.made_up import PROVENANCE, plan, record_of
from tests.runs.damage import damaged

RUN = Run(tuple(plan()[:6]), PROVENANCE)
MEASURED = 4

Damage = Callable[[list[bytes]], list[bytes]]


@pytest.fixture
def lines(tmp_path: Path) -> list[bytes]:
    """The lines of a run that has measured four of its six pairs."""
    store = PairStore(tmp_path, RUN)
    for pair in RUN.planned[:MEASURED]:
        store.append(record_of(pair, True, False))
    store.close()
    return store.path.read_bytes().splitlines(keepends=True)


def _resume(folder: Path) -> StoredRun:
    """Go on with a run, and measure what it lacks."""
    store, stored = PairStore.resume(folder, RUN)
    assert stored is not None
    for pair in RUN.planned:
        if pair.case_id not in stored.measured:
            store.append(record_of(pair, True, False))
    store.close()
    return stored


@pytest.mark.parametrize(
    ("damage", "numbers"),
    [
        (lambda lines: [*lines[:2], lines[2][:100] + b"\n", *lines[3:]], [3]),
        (lambda lines: [*lines[:2], bytes(len(lines[2])), b"\n", *lines[3:]], [3]),
        (lambda lines: [*lines[:2], lines[2].replace(b'"success"', b'"sucess"'), *lines[3:]], [3]),
        (lambda lines: [*lines[:2], lines[2].replace(b'"case_id":"p', b'"case_id":"q'), *lines[3:]], [3]),
        (lambda lines: [*lines[:2], lines[2][:-1], *lines[3:]], [3]),  # its end is gone: two pairs in a line
        (lambda lines: [*lines[:2], b"\n", *lines[2:]], [3]),
        (lambda lines: [*lines, lines[1]], [6]),
        (
            lambda lines: [lines[0], b"\x00\n", b"[" * 9999 + b"\n", b"\n", b"1e999\n", *lines[4:]],
            [2, 3, 4, 5],
        ),
    ],
    ids=["cut", "zeros", "field", "case", "joined", "empty", "twice", "many"],
)
def test_damaged_lines_are_kept_beside_the_file_and_their_pairs_played_again(
    tmp_path: Path, lines: list[bytes], damage: Damage, numbers: list[int]
) -> None:
    path = tmp_path / "pairs.jsonl"
    content = b"".join(damage(lines))
    path.write_bytes(content)
    with pytest.raises(ReportError, match=rf"line {numbers[0]}: .*--libero-max-resume"):
        read_pairs(tmp_path)
    stored = _resume(tmp_path)
    assert [line.number for line in stored.damaged] == numbers
    assert f"line {numbers[0]}: " in damage_said(stored.damaged)[0]
    was = content.split(b"\n")
    aside = (tmp_path / DAMAGED_NAME).read_bytes()
    assert aside == b"".join(was[number - 1] + b"\n" for number in numbers)
    after = read_pairs(tmp_path)
    assert after.measured == {pair.case_id for pair in RUN.planned}
    sound = [line + b"\n" for number, line in enumerate(was[:-1], start=1) if number not in numbers]
    assert path.read_bytes().startswith(b"".join(sound)), "what was sound is as it was"


def test_a_torn_line_is_kept_as_well(tmp_path: Path, lines: list[bytes]) -> None:
    path = tmp_path / "pairs.jsonl"
    path.write_bytes(b"".join(lines)[:-10])
    assert _resume(tmp_path).torn
    assert (tmp_path / DAMAGED_NAME).read_bytes() == lines[-1][:-10] + b"\n"
    assert len(read_pairs(tmp_path).records) == len(RUN.planned)


def test_nothing_is_altered_before_the_run_begins_or_when_it_may_not(
    tmp_path: Path, lines: list[bytes]
) -> None:
    path = tmp_path / "pairs.jsonl"
    content = b"".join([*lines[:2], b"damaged\n", *lines[3:]])
    path.write_bytes(content)
    one, _ = PairStore.resume(tmp_path, RUN)
    two, _ = PairStore.resume(tmp_path, RUN)
    with pytest.raises(ReportError, match="other cases"):
        PairStore.resume(tmp_path, Run(RUN.planned[1:], PROVENANCE))
    assert path.read_bytes() == content
    one.append(record_of(RUN.planned[1], True, False))
    with pytest.raises(OptionError, match="in progress"):
        two.append(record_of(RUN.planned[1], True, False))
    one.close()
    with pytest.raises(OptionError, match="written by another"):
        two.begin()


def test_a_damaged_first_line_is_refused_with_its_meaning(tmp_path: Path, lines: list[bytes]) -> None:
    path = tmp_path / "pairs.jsonl"
    path.write_bytes(b"".join([lines[0][:50] + b"\n", *lines[1:]]))
    before = path.read_bytes()
    with pytest.raises(ReportError, match=r"line 1: .*says what"):
        PairStore.resume(tmp_path, RUN)
    assert path.read_bytes() == before


def test_an_earlier_runs_damaged_lines_go_with_it(tmp_path: Path, lines: list[bytes]) -> None:
    (tmp_path / "pairs.jsonl").write_bytes(b"".join([*lines[:2], b"damaged\n", *lines[3:]]))
    _resume(tmp_path)
    PairStore(tmp_path, RUN).close()
    assert not (tmp_path / DAMAGED_NAME).exists()
    assert (tmp_path / "pairs.1.damaged").read_bytes() == b"damaged\n"


def test_whatever_is_damaged_the_run_goes_on_or_says_why_not(tmp_path: Path, lines: list[bytes]) -> None:
    path = tmp_path / "pairs.jsonl"
    refused = 0
    for seed in range(50):
        content = damaged(b"".join(lines), seed)
        path.write_bytes(content)
        (tmp_path / DAMAGED_NAME).unlink(missing_ok=True)
        try:
            _resume(tmp_path)
        except LiberoMaxError:
            refused += 1
            assert path.read_bytes() == content, "nothing is lost"
            continue
        assert len(read_pairs(tmp_path).records) == len(RUN.planned)
    assert refused < 30, "most damage is not of the first line"


def test_a_disk_without_room_for_the_repair_leaves_everything_as_it_is(
    tmp_path: Path, lines: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "pairs.jsonl"
    content = b"".join([*lines[:2], b"damaged\n", *lines[3:]])
    path.write_bytes(content)
    fsync = os.fsync

    def full(descriptor: int) -> None:
        if os.readlink(f"/proc/self/fd/{descriptor}").endswith(".repaired"):
            raise OSError("No space left on device")
        fsync(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        for _ in range(2):
            with pytest.raises(DiskError, match="Make room"):
                PairStore.resume(tmp_path, RUN)[0].append(record_of(RUN.planned[1], True, False))
            assert path.read_bytes() == content
            (tmp_path / "in-progress").unlink(missing_ok=True)
    assert os.listdir(tmp_path) == ["pairs.jsonl"]
    _resume(tmp_path)
    assert (tmp_path / DAMAGED_NAME).read_bytes() == b"damaged\n"
    assert len(read_pairs(tmp_path).records) == len(RUN.planned)
