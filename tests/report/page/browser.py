"""A real browser for tests of pages: the system's Chromium, headless, driven by Playwright."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
"""What a container without a GPU needs, and what keeps the browser from asking for anything by itself."""

_WAIT_MS = 30_000
_LOOK_MS = 50


@contextmanager
def open_browser() -> Iterator[Any]:
    """A browser with a fresh profile; the test skips where Playwright or the browser is not installed."""
    driver = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium is installed: apt-get install chromium")
    with driver.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(_FLAGS), timeout=2 * _WAIT_MS)
        try:
            yield browser
        finally:
            browser.close()


class Shown:
    """A page of a file as a browser shows it; what it complains about is kept.

    Args:
        browser: See :func:`open_browser`.
        path: The file.
        width: Of the window, pixels.
        dark: Whether the user prefers dark pages.
        script: Whether scripts run.
        table: Whether the page has a table of cases.
    """

    def __init__(
        self, browser: Any, path: Path, fragment: str = "", *, width: int = 1280, dark: bool = False,
        script: bool = True, table: bool = True,
    ) -> None:  # fmt: skip
        scheme = "dark" if dark else "light"
        context = browser.new_context(
            viewport={"width": width, "height": 900},
            color_scheme=scheme,
            java_script_enabled=script,
            offline=True,
        )
        context.set_default_timeout(_WAIT_MS)
        self.page = context.new_page()
        self.complaints: list[str] = []
        self.page.on("console", lambda message: self.complaints.append(message.text))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(f"{path.as_uri()}{fragment}")
        if script and table:  # the table is drawn once its data are unpacked
            self.page.locator("[role=status]").wait_for()
        if "case=" in fragment:  # and a case once its details are
            self.page.locator(".detail").wait_for()

    def until(self, expression: str) -> None:
        """Wait for an expression to hold. The page's policy forbids what Playwright's own wait does."""
        waited = 0
        while not self.page.evaluate(expression):
            assert waited < _WAIT_MS, f"{expression} does not hold after {_WAIT_MS / 1000:g} s"
            self.page.wait_for_timeout(_LOOK_MS)
            waited += _LOOK_MS

    def cases(self) -> list[str]:
        """The names of the cases in the table, from top to bottom."""
        return list(self.page.locator(".cases > tbody > tr > th").all_inner_texts())

    @property
    def status(self) -> str:
        return str(self.page.locator("[role=status]").inner_text())

    @property
    def fragment(self) -> str:
        return str(self.page.evaluate("location.hash"))

    def too_wide(self) -> list[str]:
        """What reaches beyond the right edge of the window."""
        return list(self.page.evaluate(_TOO_WIDE))


_TOO_WIDE = """() => {
  const width = window.innerWidth;
  if (document.documentElement.scrollWidth <= width) return [];
  const beyond = (place) => place.getBoundingClientRect().right > width;
  const found = [...document.querySelectorAll("body *")].filter(beyond);
  return ["the page", ...found.slice(0, 9).map((place) => place.outerHTML.slice(0, 200))];
}"""
