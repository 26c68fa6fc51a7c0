"""Published runs side by side: what stands in which table, what is verified, and what is refused."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.cli import main
from pytest_libero_max.errors import OptionError, ReportError
from pytest_libero_max.lab.index.index_page import index_html
from pytest_libero_max.lab.index.run_index import published_in, run_index
from pytest_libero_max.report.publication import note_check, pairs_digest, publish, read_checks
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from tests.report.made_up import POLICY, PROVENANCE, plan, record_of
from tests.report.page.browser import open_browser

HOSTILE = "<script>alert(1)</script>"


def _publish(folder: Path, name: str, lost: int, *, pairs: int = 32, policy: str = "scripted") -> Path:
    """Publish a run in which Base succeeds in all pairs, and Dynamic in all but so many."""
    planned = plan()[:pairs]
    provenance: Any = PROVENANCE | {"case_set": {"name": f"manifest {name[0]}.json", "digest": "0" * 64}}
    store = PairStore(folder / f"run-{name}", Run(tuple(planned), provenance))
    for number, pair in enumerate(planned):
        store.append(structs.replace(record_of(pair, True, number >= lost), policy=POLICY | {"name": policy}))
    store.close()
    publish(folder / f"run-{name}", folder / "published" / name)
    return folder / "published" / name


@pytest.fixture(scope="module")
def unaltered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tmp_path = tmp_path_factory.mktemp("runs")
    for name, lost in (("a-good", 1), ("a-bad", 20), ("a-middle", 8)):
        _publish(tmp_path, name, lost, policy=name)
    _publish(tmp_path, "b-other", 3, pairs=16, policy=HOSTILE)
    return tmp_path / "published"


@pytest.fixture
def published(unaltered: Path, tmp_path: Path) -> Path:
    return shutil.copytree(unaltered, tmp_path / "published")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as browser:
        yield browser


def test_only_runs_of_the_same_cases_stand_in_one_table_the_best_first(published: Path) -> None:
    index = run_index(published_in([published]), {})
    assert [[run.folder.name for run in group] for group in index.groups.values()] == [
        ["a-good", "a-middle", "a-bad"],
        ["b-other"],
    ]
    assert not index.refused


def test_a_run_is_verified_by_the_bytes_of_its_pairs(published: Path, tmp_path: Path) -> None:
    file, run = tmp_path / "verified.json", published / "a-good"
    assert read_checks(file) == {}
    note_check(file, run, 2, "17", False)
    note_check(file, published / "a-bad", 1, "5", True)
    assert json.loads(file.read_text())[pairs_digest(run)]["seed"] == "17"
    checks = read_checks(file)
    assert {*checks} == {pairs_digest(run), pairs_digest(published / "a-bad")}
    page = index_html(run_index(published_in([published]), checks), tmp_path)
    assert "2 of 4 verified" in page
    assert "2 pairs played" in page
    assert "1 pair played" in page
    shutil.copy(published / "a-middle" / "pairs.jsonl.gz", run / "pairs.jsonl.gz")
    shutil.copy(published / "a-middle" / "report.md", run / "report.md")
    assert "1 of 4 verified" in index_html(run_index(published_in([published]), checks), tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"a": {"pairs": 1}}', '{"a": 1}'])
def test_a_file_that_holds_no_checks_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "verified.json").write_text(text)
    with pytest.raises(ReportError, match=r"publish verify FOLDER --record"):
        read_checks(tmp_path / "verified.json")


def test_an_altered_run_is_named_and_in_no_table(
    published: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = published / "a-good" / "report.md"
    report.write_text(report.read_text().replace("96.9%", "99.9%", 1))
    page = tmp_path / "index.html"
    assert main(["publish", "index", str(published), "--output", str(page)]) == 1
    assert "report.md, line" in capsys.readouterr().out
    text = page.read_text()
    assert "Refused: published/a-good. " in text
    assert "3 published runs" in text
    assert ">a-good (" not in text


def test_a_folder_without_published_runs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no published run"):
        published_in([tmp_path])


def test_names_of_policies_are_text_and_links_lead_to_the_runs(published: Path, tmp_path: Path) -> None:
    page = tmp_path / "pages" / "index.html"
    page.parent.mkdir()
    assert main(["publish", "index", str(published), "--output", str(page)]) == 0
    text = page.read_text()
    assert HOSTILE not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text
    for link in re.findall(r"href='([^']*)'", text):
        assert link == "#main" or (page.parent / link).is_file()


def test_rows_are_sorted_by_a_click_on_a_heading(browser: Any, published: Path, tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    assert main(["publish", "index", str(published), "--output", str(path)]) == 0
    complaints: list[str] = []
    page = browser.new_context(offline=True).new_page()
    page.on("console", lambda message: complaints.append(message.text))
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    assert complaints == []
    assert (
        page.locator(".sorted").first.locator("tbody tr").count() == 4
    )  # all runs; then those of the same cases
    page.locator("summary").first.click()
    table = page.locator(".sorted").nth(1)

    def names() -> list[str]:
        return [text.split(" ")[0] for text in table.locator("tbody th").all_inner_texts()]

    assert names() == ["a-good", "a-middle", "a-bad"]
    table.get_by_role("button", name="Dynamic success").click()
    assert names() == ["a-bad", "a-middle", "a-good"]
    table.get_by_role("button", name="Base successes lost").click()
    assert names() == ["a-good", "a-middle", "a-bad"]
    table.get_by_role("button", name="Policy").click()
    assert names() == ["a-bad", "a-good", "a-middle"]
    table.get_by_role("button", name="Policy").click()
    assert names() == ["a-middle", "a-good", "a-bad"]
    assert table.locator("th[aria-sort=descending]").count() == 1


def test_authors_and_model_stand_beside_a_run_that_states_them(unaltered: Path, tmp_path: Path) -> None:
    run, folder = unaltered.parent / "run-a-good", tmp_path / "published"
    stated = ["--authors", "A. <b> and B.", "--model", "https://example.org/model"]
    assert main(["publish", "pack", str(run), str(folder), *stated]) == 0
    text = index_html(run_index(published_in([folder]), {}), tmp_path)
    assert "A. &lt;b&gt; and B." in text
    assert "<a href='https://example.org/model'>example.org/model</a>" in text
    assert "Authors" not in index_html(run_index(published_in([unaltered]), {}), tmp_path)


@pytest.mark.parametrize("model", ["javascript:alert(1)", "example.org"])
def test_a_model_is_an_address_on_the_web(
    unaltered: Path, tmp_path: Path, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run, folder = unaltered.parent / "run-a-good", tmp_path / "published"
    assert main(["publish", "pack", str(run), str(folder), "--model", model]) != 0
    assert f"--model={model!r}" in capsys.readouterr().err
    assert not folder.exists()
    shutil.copytree(unaltered / "a-good", folder)
    (folder / "about.json").write_text(json.dumps({"model": model}))
    ((_, reason),) = run_index(published_in([folder]), {}).refused
    assert "an address" in reason
