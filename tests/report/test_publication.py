"""What is published, and that everything in ``reports`` follows from the pairs beside it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
from pytest_libero_max.report.comparison.compare_files import write_comparison
from pytest_libero_max.report.publication import publish, published_files
from pytest_libero_max.report.writers.files import report_of
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PairStore, read_pairs
from tests.report.made_up import PROVENANCE, plan, records_of

REPORTS = Path(__file__).parents[2] / "reports"
COMPARISON = "comparison.json"
RUNS = sorted(path.parent for path in REPORTS.rglob("report.json"))
COMPARISONS = sorted(path.parent for path in REPORTS.rglob(COMPARISON))


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_runs_are_published() -> None:
    assert RUNS
    assert [path.parent for path in sorted(REPORTS.rglob(PACKED_PAIRS_NAME))] == RUNS


@pytest.fixture
def run(tmp_path: Path) -> Path:
    pairs = plan()
    store = PairStore(tmp_path / "run", Run(tuple(pairs), PROVENANCE))
    for record in records_of(pairs):
        store.append(record)
    store.close()
    return tmp_path / "run"


def test_a_published_run_is_read_and_published_again_with_the_same_bytes(run: Path, tmp_path: Path) -> None:
    once = publish(run, tmp_path / "once")
    again = publish(tmp_path / "once", tmp_path / "again")
    assert [path.name for path in once] == [path.name for path in again]
    assert {path.name for path in once} == {path.name for path in (tmp_path / "once").iterdir()}
    for one, other in zip(once, again, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert read_pairs(tmp_path / "once") == read_pairs(run)


def test_an_incomplete_run_is_not_published(run: Path, tmp_path: Path) -> None:
    lines = (run / "pairs.jsonl").read_text().splitlines(keepends=True)
    (run / "pairs.jsonl").write_text("".join(lines[:-1]))
    with pytest.raises(ReportError, match="31 of 32 planned pairs were played"):
        publish(run, tmp_path / "published")
    assert not (tmp_path / "published").exists()


@pytest.mark.parametrize("folder", RUNS, ids=lambda folder: str(folder.relative_to(REPORTS)))
def test_everything_in_a_published_run_follows_from_its_pairs(folder: Path) -> None:
    files = published_files(report_of(read_pairs(folder / PACKED_PAIRS_NAME)))
    assert {path.name for path in folder.iterdir()} == {*files, PACKED_PAIRS_NAME}
    for name, content in files.items():
        published = (folder / name).read_text(encoding="utf-8")
        if name.endswith(".json"):
            assert _alike(json.loads(published), json.loads(content)), name
        else:
            assert published == content.decode(), name


@pytest.mark.parametrize("folder", COMPARISONS, ids=lambda folder: str(folder.relative_to(REPORTS)))
def test_a_published_comparison_follows_from_the_runs_beside_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The comparison is made in a copy, because its page holds the ways from it to the runs."""
    copy = shutil.copytree(folder, tmp_path / "copy", ignore=shutil.ignore_patterns("comparison.*"))
    monkeypatch.chdir(copy)
    runs = read_runs(sorted(Path(path.name) for path in copy.iterdir() if path.is_dir()))
    written = {path.name: path for path in write_comparison(compare_runs(runs), Path(), common_cases(runs))}
    assert {path.name for path in folder.iterdir() if path.is_file()} == {*written}
    for name, path in written.items():
        if name.endswith(".json"):
            assert _alike(json.loads((folder / name).read_text()), json.loads(path.read_text()))
        elif not name.endswith(".png"):  # drawn by a library whose versions may differ
            assert (folder / name).read_text() == path.read_text(), name


def _alike(one: Any, other: Any) -> bool:
    """Whether two JSON values are equal, numbers to nine digits."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(_alike, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return one == pytest.approx(other, rel=1e-9, abs=1e-12)
    return bool(one == other) and type(one) is type(other)


def test_a_changed_number_is_found() -> None:
    assert _alike({"a": [1, 0.1]}, {"a": [1, 0.1 + 1e-15]})
    assert not _alike({"a": [1, 0.1]}, {"a": [1, 0.1001]})
    assert not _alike({"a": [1]}, {"a": [True]})
