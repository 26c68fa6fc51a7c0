"""What is published, and that everything in ``reports`` follows from the pairs beside it."""

from __future__ import annotations

import base64
import gzip
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.cli import main
from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs, read_runs
from pytest_libero_max.report.comparison.compare_files import write_comparison
from pytest_libero_max.report.publication import checked, pairs_digest, publish, read_checks
from pytest_libero_max.report.writers.report_files import HTML_NAME
from pytest_libero_max.runs.media import films_in
from pytest_libero_max.runs.store import PACKED_PAIRS_NAME, read_pairs
from tests.report.made_up import page_cases, plan, records_of, run_of, write_run

REPORTS = Path(__file__).parents[2] / "reports"
COMPARISON = "comparison.md"
RUNS = sorted(path.parent for path in REPORTS.rglob("report.md"))
COMPARISONS = sorted(path.parent for path in REPORTS.rglob(COMPARISON))


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_runs_are_published() -> None:
    assert RUNS
    assert [path.parent for path in sorted(REPORTS.rglob(PACKED_PAIRS_NAME))] == RUNS


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_the_index_has_a_row_for_each_published_run() -> None:
    text = (REPORTS / "index.html").read_text(encoding="utf-8")
    for folder in RUNS:
        assert f"href='{folder.relative_to(REPORTS).as_posix()}/report.md'" in text
        assert f"data-order='{pairs_digest(folder)}'" in text
    assert f"{len(RUNS)} published runs" in text
    assert "Refused: " not in text
    assert {*read_checks(REPORTS / "verified.json")} <= {pairs_digest(folder) for folder in RUNS}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", run_of(plan(), records_of(plan())))


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
    with pytest.raises(ReportError, match="31 of 32 planned"):
        publish(run, tmp_path / "published")
    assert not (tmp_path / "published").exists()


@pytest.mark.parametrize("folder", RUNS, ids=lambda folder: str(folder.relative_to(REPORTS)))
def test_the_report_of_a_published_run_follows_from_its_pairs(folder: Path) -> None:
    if folder.parent.name in ("safety", "monitors"):
        pytest.importorskip("pytest_libero_max.lab.sections")  # the page has sections of the lab
    assert {"report.md", PACKED_PAIRS_NAME} <= {path.name for path in folder.iterdir()}
    assert [line for line in checked(folder) if line.startswith("numbers: ")]


@pytest.mark.skipif(not REPORTS.is_dir(), reason="the source distribution has no reports")
def test_a_page_is_published_with_films() -> None:
    assert [path for path in REPORTS.rglob(HTML_NAME) if films_in(path.parent)]


def _flip(lines: list[Any]) -> None:
    pair = next(line for line in lines[1:] if line["arms"]["dynamic"]["firings"])
    pair["arms"]["dynamic"]["success"] ^= True


def _remove(lines: list[Any]) -> None:
    del lines[-1]


def _remove_and_replan(lines: list[Any]) -> None:
    gone = lines.pop()["case_id"]
    lines[0]["planned"] = [pair for pair in lines[0]["planned"] if pair["case_id"] != gone]


def _alter_case(lines: list[Any]) -> None:
    case = lines[1]["case_id"]
    planned = next(pair for pair in lines[0]["planned"] if pair["case_id"] == case)
    planned["case_digest"] = lines[1]["case_digest"] = "0" * 64


def _alter_group(lines: list[Any]) -> None:
    lines[0]["planned"][0]["task"] = "libero_goal/9"


@pytest.mark.parametrize(
    ("tamper", "message"),
    [
        (_flip, r"report\.md, line \d+: '.*'"),
        (_remove, "31 of 32 planned"),
        (_remove_and_replan, "32 of 32 cases .* 31 planned"),
        (_alter_case, "planned pair '.*' of .* track smoke"),
        (_alter_group, "planned pair '.*' of .* track smoke"),
    ],
)
def test_a_folder_whose_pairs_were_altered_is_refused(
    tamper: Callable[[list[Any]], None], message: str, tmp_path: Path
) -> None:
    folder = shutil.copytree(REPORTS / "smoke" / "expert", tmp_path / "expert")
    packed = folder / PACKED_PAIRS_NAME
    lines = [json.loads(line) for line in gzip.decompress(packed.read_bytes()).splitlines()]
    tamper(lines)
    packed.write_bytes(gzip.compress("".join(json.dumps(line) + "\n" for line in lines).encode()))
    with pytest.raises(ReportError, match=message):
        list(checked(folder))


def test_a_folder_with_an_altered_number_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shutil.copytree(REPORTS / "smoke" / "expert", tmp_path / "expert")
    assert main(["report", str(folder)]) == 0
    assert main(["publish", "verify", str(folder), "--pairs=0"]) == 0
    said = capsys.readouterr().out
    assert re.search("numbers: .* report.md, report.json", said)
    assert "policy: expert\n" in said
    report = folder / "report.json"
    report.write_text(report.read_text().replace('"played": 32', '"played": 31', 1))
    assert main(["publish", "verify", str(folder), "--pairs=0"]) == 1
    assert re.findall(r'"played": \d+', capsys.readouterr().err) == ['"played": 31', '"played": 32']


def test_a_folder_that_was_not_published_is_refused(run: Path) -> None:
    with pytest.raises(ReportError, match=r"publish pack RUN"):
        list(checked(run))


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


def _alter(path: Path, before: str, after: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), encoding="utf-8")


def _swap_cases(path: Path, before: str, after: str) -> None:
    """Alter what the page holds packed."""
    text = path.read_text(encoding="utf-8")
    (packed,) = re.findall(r"id='cases-data'>([^<]*)", text)
    data = gzip.decompress(base64.b64decode(packed)).decode()
    assert before in data
    altered = base64.b64encode(gzip.compress(data.replace(before, after).encode())).decode()
    path.write_text(text.replace(packed, altered), encoding="utf-8")


def test_a_folder_with_an_altered_page_or_figure_is_refused(tmp_path: Path) -> None:
    folder = shutil.copytree(REPORTS / "smoke" / "stale_expert", tmp_path / "run")
    assert main(["report", str(folder), "--figures"]) == 0
    (line,) = (line for line in checked(folder) if line.startswith("numbers: "))
    assert {"report.md", "report.html", "report.json", "base-to-dynamic.svg"} <= {
        *line.split(" in ")[1].split(", ")
    }
    for name, alter, before, after, message in (
        ("report.html", _alter, "28.1 pp", "2.1 pp", "report.html shows words"),
        ("report.html", _swap_cases, "stale", "fresh", "report.html shows cases"),
        ("base-to-dynamic.svg", _alter, "</svg>", "<g/></svg>", r"base-to-dynamic.svg, line \d+: "),
        ("report.md", _alter, "stale-expert", "fresh-expert", r"report.md, line \d+: "),
    ):
        kept = (folder / name).read_bytes()
        alter(folder / name, before, after)
        with pytest.raises(ReportError, match=message):
            list(checked(folder))
        (folder / name).write_bytes(kept)


def test_actions_that_the_run_did_not_keep_are_not_published(run: Path, tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="--libero-max-traces=all"):
        publish(run, tmp_path / "published", actions=True)
