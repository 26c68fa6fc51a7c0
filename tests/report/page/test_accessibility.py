"""The pages read by axe-core: names, roles, landmarks, headings and contrast, in both schemes."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from pytest_libero_max.report.comparison.compare import common_cases, compare_runs
from pytest_libero_max.report.comparison.compare_files import comparison_html
from pytest_libero_max.report.writers.report_files import report_of, run_page
from tests.report.made_up import error_of, plan, record_of, run_of
from tests.report.page.browser import Shown, open_browser

PAIRS = plan()


@pytest.fixture(scope="module")
def axe() -> str:
    """The source of axe-core, which a package for Playwright brings along."""
    package = pytest.importorskip("axe_playwright_python", reason="pip install axe-playwright-python")
    return (resources.files(package) / "axe.min.js").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A run with a loss of every kind, one without a played pair, and a comparison."""
    folder = tmp_path_factory.mktemp("pages")
    runs = {
        name: run_of(PAIRS, (record_of(pair, at % 3 > 0, at % rhythm > 0) for at, pair in enumerate(PAIRS)))
        for name, rhythm in (("first", 2), ("second", 5))
    }
    nothing = run_of(PAIRS[:2], [], errors=map(error_of, PAIRS[:2]))
    comparison = compare_runs(runs)
    texts = {
        "run": run_page(report_of(runs["first"]), runs["first"], folder),
        "nothing": run_page(report_of(nothing), nothing, folder),
        "comparison": comparison_html(comparison, common_cases(runs), folder),
    }
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: folder / f"{name}.html" for name in texts}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as browser:
        yield browser


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("name", ["run", "nothing", "comparison"])
def test_axe_finds_nothing(browser: Any, axe: str, pages: dict[str, Path], name: str, dark: bool) -> None:
    fragment = f"#cases?case={PAIRS[0].item_id}" if name in ("run", "comparison") else ""
    shown = Shown(browser, pages[name], fragment, dark=dark)
    assert complaints(shown, axe) == []


def complaints(shown: Shown, axe: str) -> list[tuple[str, str]]:
    """The rules of axe-core that a page breaks, with everything unfolded, and the first place of each."""
    shown.page.evaluate("for (const details of document.querySelectorAll('details')) details.open = true")
    shown.page.evaluate(f"() => {{ {axe} }}")
    found = shown.page.evaluate("async () => (await axe.run()).violations")
    return [(one["id"], one["nodes"][0]["html"][:160]) for one in found]
