"""Picture of the first screen of the published page: ``python -m tests.report.page.first_screen``."""

from __future__ import annotations

from pathlib import Path

from tests.report.page.browser import Shown, open_browser

REPORTS = Path(__file__).parents[3] / "reports"

WIDTH = 1280
_MARGIN_PX = 16
_FILMS = "[...document.querySelectorAll('video')].every((film) => film.readyState > 1 && !film.seeking)"


def main() -> None:
    """Write ``reports/first-screen.png``, down to the cards of what broke."""
    with open_browser() as browser:
        shown = Shown(browser, REPORTS / "smoke" / "stale_expert" / "report.html", width=WIDTH)
        shown.until(_FILMS)
        page = shown.page
        box = page.locator(".strip").first.bounding_box()
        clip = {"x": 0, "y": 0, "width": WIDTH, "height": box["y"] + box["height"] + _MARGIN_PX}
        page.screenshot(path=REPORTS / "first-screen.png", full_page=True, clip=clip)


if __name__ == "__main__":
    main()
