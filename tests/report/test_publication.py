"""What is published, and that everything in ``reports`` follows from the pairs beside it."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
from pytest_libero_max.report.comparison.compare_files import write_comparison
from pytest_libero_max.report.publication import publish
from pytest_libero_max.report.writers.markdown import markdown
from pytest_libero_max.report.writers.report_files import report_of
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, PairStore, read_pairs
from tests.report.made_up import PROVENANCE, page_cases, plan, records_of

REPORTS = Path(__file__).parents[2] / "reports"
COMPARISON = "comparison.md"
RUNS = sorted(path.parent for path in REPORTS.rglob("report.md"))
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
def test_the_report_of_a_published_run_follows_from_its_pairs(folder: Path) -> None:
    assert {"report.md", PACKED_PAIRS_NAME} <= {path.name for path in folder.iterdir()}
    report = report_of(read_pairs(folder / PACKED_PAIRS_NAME))
    assert (folder / "report.md").read_text(encoding="utf-8") == markdown(report)


def test_one_command_makes_every_file_of_a_published_run(tmp_path: Path) -> None:
    run = shutil.copytree(REPORTS / "smoke" / "stale_expert", tmp_path / "run")
    assert main(["report", str(run)]) == 0
    assert {"report.json", "report.html", "report.md"} <= {path.name for path in run.iterdir()}


@pytest.mark.parametrize("folder", COMPARISONS, ids=lambda folder: str(folder.relative_to(REPORTS)))
def test_a_published_comparison_follows_from_the_runs_beside_it(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The comparison is made in a copy, because its page holds the ways from it to the runs."""
    copy = shutil.copytree(folder, tmp_path / "copy", ignore=shutil.ignore_patterns("comparison.*"))
    monkeypatch.chdir(copy)
    runs = read_runs(sorted(Path(path.name) for path in copy.iterdir() if path.is_dir()))
    written = {path.name: path for path in write_comparison(compare_runs(runs), Path(), common_cases(runs))}
    for path in folder.iterdir():
        if path.is_file():
            assert _content(path) == _content(written[path.name]), path.name


def _content(path: Path) -> tuple[str, object]:
    """The text of a file, and the data of a page, which other versions of zlib compress to other bytes."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".html":
        return text, None
    return re.sub(r"(?<=-data'>)[^<]*", "", text), page_cases(text)
