"""The pages in a real browser: layout, filters, order, keyboard, and that nothing is complained about."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from pytest_libero_max.films.encoding import write_film
from pytest_libero_max.policies.transforms.images import png_file
from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import common_cases, compare_runs
from pytest_libero_max.report.comparison.compare_files import write_comparison
from pytest_libero_max.report.writers.report_files import run_page
from pytest_libero_max.runs.media import FILMS_NAME, PICTURES_NAME, film_name
from tests.report.made_up import NEVER_TRIGGERED, error_of, plan, record_of, run_of
from tests.report.page.browser import Shown, open_browser

HOSTILE = "</script><script>alert(1)</script><b>put it down</b>"
PAIRS = [
    pair if index % 3 else replace(pair, source_category=f"Robot Initial States {'of a long name ' * 3}")
    for index, pair in enumerate(plan(per_cell=4))
]
MISSING, INVALID, FIRST, NEVER = PAIRS[0], PAIRS[1], PAIRS[2], PAIRS[3]
WIDTHS = (390, 1280)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as browser:
        yield browser


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of 128 pairs: one is missing, one invalid, one has a film; one without the event has pictures."""
    folder = tmp_path_factory.mktemp("run")
    records = [record_of(FIRST, True, False, instruction=HOSTILE, stale_actions=9, response_step=32)]
    records += [record_of(NEVER, False, False, **NEVER_TRIGGERED)]
    records += [
        record_of(pair, index % 4 > 0, index % 3 > 0, stale_actions=index % 5, response_step=23 + index % 5)
        for index, pair in enumerate(PAIRS[4:])
    ]
    stored = run_of(PAIRS, records, errors=[error_of(INVALID)])
    pytest.importorskip("av", reason="the film is an MP4: pip install av")
    frames = np.linspace(0, 255, 12 * 48 * 96 * 3).astype(np.uint8).reshape(12, 48, 96, 3)
    write_film(
        folder / FILMS_NAME / film_name(FIRST.item_id, ("base", "dynamic"), ".mp4"), enumerate(frames), 20
    )
    for camera, when in product(("agentview", "robot0_eye_in_hand"), ("before", "after")):
        picture = folder / PICTURES_NAME / f"{NEVER.item_id}--{camera}-{when}.png"
        picture.parent.mkdir(exist_ok=True)
        picture.write_bytes(png_file(frames[0]))
    report = build_report(stored.records, stored.errors, stored.run.planned, stored.run.provenance)
    (folder / "report.html").write_text(run_page(report, stored, folder), encoding="utf-8")
    return folder / "report.html"


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_a_page_fits_its_window_and_nothing_is_complained_about(
    browser: Any, page: Path, width: int, dark: bool
) -> None:
    assert Shown(browser, page, width=width, dark=dark).too_wide() == []
    shown = Shown(browser, page, f"#cases?case={FIRST.item_id}", width=width, dark=dark)
    shown.page.evaluate("for (const details of document.querySelectorAll('details')) details.open = true")
    assert shown.page.get_by_role("heading", name="Commands").is_visible()
    assert shown.too_wide() == []
    cases = shown.page.locator(".cases")
    assert cases.evaluate("(table) => table.scrollWidth <= table.parentElement.clientWidth")
    assert shown.complaints == []
    paper, ink = (
        [
            int(part)
            for part in re.findall(r"\d+", shown.page.evaluate(f"getComputedStyle(document.body).{name}"))
        ]
        for name in ("backgroundColor", "color")
    )
    assert (sum(paper) < sum(ink)) is dark


def test_without_a_script_the_tables_are_there_and_nothing_else_is_promised(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, width=390, script=False)
    assert shown.page.get_by_text("Base success", exact=True).first.is_visible()
    assert shown.page.get_by_text("pairs succeed in Base and fail in Dynamic").is_visible()
    assert not shown.page.get_by_role("heading", name="Cases", exact=True).is_visible()
    assert shown.page.locator("table").count() > 10


def test_cases_are_filtered_and_the_address_says_so(browser: Any, page: Path) -> None:
    shown = Shown(browser, page)
    assert shown.status.startswith("128 of 128 cases; 1 to 50 ")
    assert len(shown.cases()) == 50
    shown.page.get_by_label("Event", exact=True).select_option("camera_shift")
    chip = shown.page.get_by_role("group", name="Outcome").get_by_role("button", name="regression")
    assert chip.get_attribute("aria-pressed") == "false"
    chip.focus()
    shown.page.keyboard.press("Enter")
    assert chip.get_attribute("aria-pressed") == "true"
    assert chip.evaluate("(button) => button === document.activeElement")
    chosen = shown.cases()
    assert chosen
    assert all("camera_shift" in name for name in chosen)
    assert shown.fragment == "#cases?event=camera_shift&outcome=regression"
    again = Shown(browser, page, shown.fragment)
    assert again.cases() == chosen
    chip = again.page.get_by_role("group", name="Outcome").get_by_role("button", name="regression")
    assert chip.inner_text() == f"regression {len(chosen)}"
    chip.click()
    assert again.fragment == "#cases?event=camera_shift"
    again.page.get_by_role("button", name="Show all").click()
    assert again.status.startswith("128 of 128")


@pytest.mark.parametrize(
    ("fragment", "cases"),
    [
        ("q=put+it+DOWN", [FIRST.item_id]),
        ("stale_from=9", [FIRST.item_id]),
        ("outcome=invalid", [INVALID.item_id]),
        ("outcome=missing", [MISSING.item_id]),
        ("film=yes", [FIRST.item_id]),
        (f"q={NEVER.item_id}&stale_to=100", []),
    ],
)
def test_an_address_opens_a_view(browser: Any, page: Path, fragment: str, cases: list[str]) -> None:
    shown = Shown(browser, page, f"#cases?{fragment}&sort=nonsense&event=nonsense&dynamic_steps_from=x")
    assert shown.cases() == cases
    if not cases:
        assert shown.status == "None of 128 cases is like that."


def test_cases_are_put_in_order_by_the_heads_of_the_table_and_by_keyboard(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, "#cases?outcome=regression")
    names = shown.cases()
    assert names == sorted(names)
    head = shown.page.locator(".cases").get_by_role("columnheader", name="Stale actions")
    head.get_by_role("button").focus()
    shown.page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "ascending"
    shown.page.keyboard.press("Enter")  # the button is still in focus
    assert head.get_attribute("aria-sort") == "descending"
    heads = shown.page.locator(".cases > thead > tr").first.get_by_role("columnheader").all_inner_texts()
    place = 1 + next(number for number, text in enumerate(heads) if "Stale" in text)
    cells = shown.page.locator(f".cases > tbody > tr > td:nth-child({place})").all_inner_texts()
    stale = [int(text) for text in cells]
    assert stale == sorted(stale, reverse=True)
    assert stale[0] == 9
    assert shown.fragment.endswith("sort=-stale")


def test_a_case_shows_its_film_its_event_its_numbers_and_its_command(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, f"#cases?case={FIRST.item_id}")
    detail = shown.page.locator(".detail")
    assert detail.locator("video").get_attribute("src") == f"films/{FIRST.item_id}--base-dynamic.mp4"
    can_be_played = "document.querySelector('.detail video').readyState >= 2"
    shown.until(can_be_played)
    assert "-k " + FIRST.item_id in detail.locator("code").first.inner_text()
    detail.get_by_text("Case, parameters and evidence").click()
    assert HOSTILE in detail.inner_text()  # as text, and nothing of it ran
    assert shown.page.locator("b", has_text="put it down").count() == 0
    assert detail.get_by_role("rowheader", name="Steps", exact=True).is_visible()
    detail.get_by_role("button", name="Copy").first.click()
    detail.get_by_role("button", name="Copied").wait_for()
    shown.page.get_by_role("button", name=FIRST.item_id).click()
    assert detail.count() == 0
    assert shown.complaints == []
    other = Shown(browser, page, f"#cases?case={PAIRS[6].item_id}").page.locator(".detail")
    assert other.locator("img").get_attribute("alt").startswith(PAIRS[6].event_variant)
    pictures = Shown(browser, page, f"#cases?case={NEVER.item_id}").page.locator(".detail figure")
    captions = ["agentview-before", "agentview-after", "robot0_eye_in_hand-before"]
    assert pictures.all_inner_texts()[:3] == captions
    error = Shown(browser, page, f"#cases?case={INVALID.item_id}").page.locator(".detail")
    assert "qpos is not finite" in error.inner_text()


def test_a_film_is_stepped_through_and_its_event_is_found(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, f"#cases?case={FIRST.item_id}")
    card = shown.page.locator(".detail")
    shown.until("document.querySelector('.detail video').readyState >= 2")
    seek, said, now = card.get_by_label("Policy step"), card.locator("output"), "(video) => video.currentTime"
    record = record_of(FIRST, True, False)
    assert record.trigger is not None
    event, steps = record.trigger.step, record.dynamic_steps or 0
    assert said.inner_text().startswith(f"step {event} of {steps}, ")
    assert said.inner_text().endswith(", 0 after the event")
    for back in range(1, event - 5):
        card.get_by_role("button", name="One step back").click()
        assert said.inner_text().startswith(f"step {event - back} of ")
    assert card.locator("video").evaluate(now) == pytest.approx(6.5 / 20, abs=1e-3)
    seek.focus()
    shown.page.keyboard.press("ArrowRight")
    assert seek.input_value() == "7"
    assert card.locator("video").evaluate(now) == pytest.approx(7.5 / 20, abs=1e-3)
    card.get_by_role("button", name="To the event").click()
    assert seek.input_value() == str(event)
    assert card.locator("line.event").count() == 1
    assert f"dynamic: failed after {steps} steps" in card.inner_text()
    assert shown.complaints == []


def test_the_first_screen_shows_what_broke_with_its_film(browser: Any, page: Path) -> None:
    shown = Shown(browser, page)
    headline = shown.page.locator(".headline").inner_text()
    assert re.fullmatch(r"[-+]\d+\.\d pp", headline)
    assert shown.page.locator(".first").inner_text().count(headline) == 1
    assert shown.page.locator(".verdict").bounding_box()["y"] < 400
    film = shown.page.locator(".poster video")
    assert film.get_attribute("src").startswith(f"films/{FIRST.item_id}--base-dynamic.mp4#t=")
    shown.page.locator(".poster a").click()
    shown.page.locator(".detail video").wait_for()
    rows = shown.page.locator(".plot tbody tr")
    assert rows.count() == 9
    rows.nth(1).get_by_role("link").click()
    assert shown.fragment == f"#cases?event={rows.nth(1).get_by_role('link').inner_text()}"


def test_details_are_unpacked_when_a_case_of_their_part_is_opened(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, f"#cases?case={sorted(pair.item_id for pair in PAIRS)[-1]}")
    assert shown.page.locator(".details-data").count() == 2  # of 100 cases, and of the others
    assert shown.page.locator(".detail").get_by_role("heading", name="Commands").is_visible()


def test_pages_are_turned_and_groups_lead_to_their_cases(browser: Any, page: Path) -> None:
    shown = Shown(browser, page)
    first = shown.cases()
    shown.page.get_by_role("link", name="Breakdowns").click()
    assert shown.cases() == first
    shown.page.get_by_role("button", name="Next", exact=True).click()
    assert shown.status.endswith("51 to 100 are shown.")
    assert not set(first) & set(shown.cases())
    shown.page.get_by_role("link", name="Regressions").click()
    assert shown.fragment == "#cases?outcome=regression"
    shown.page.locator(".cases > tbody > tr:first-child", has_text="regression").wait_for(timeout=5_000)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_comparison_fits_its_window_and_shows_what_changed(
    browser: Any, tmp_path: Path, width: int
) -> None:
    pairs = PAIRS[:40]
    runs = {
        str(tmp_path / name): run_of(
            pairs, (record_of(pair, True, bool(index % rhythm)) for index, pair in enumerate(pairs))
        )
        for name, rhythm in (("first", 2), ("second_of_the_runs", 4), ("third", 8))
    }
    write_comparison(compare_runs(runs), tmp_path, common_cases(runs))
    shown = Shown(browser, tmp_path / "comparison.html", width=width)
    assert shown.too_wide() == []
    assert shown.status.startswith("15 of 40 cases")
    shown.page.get_by_label("second_of_the_runs", exact=True).select_option("regression")
    assert shown.status.startswith("5 of 40 cases")
    again = Shown(browser, tmp_path / "comparison.html", shown.fragment, width=width)
    assert again.cases() == shown.cases()
    shown.page.locator(".cases > tbody button").first.click()
    shown.page.locator(".detail").wait_for()
    assert shown.page.locator(".detail .command").count() == 3
    assert shown.too_wide() == []
    assert shown.complaints == []


def test_keys_open_the_next_regression_and_close_it(browser: Any, page: Path) -> None:
    shown = Shown(browser, page)
    lost = shown.page.locator(".cases > tbody > tr", has_text="regression").count()
    first, second = shown.cases()[:2]
    assert lost > 1
    shown.page.keyboard.press("n")
    shown.page.locator(".detail").wait_for()
    assert shown.fragment == f"#cases?case={first}"
    shown.page.keyboard.press("n")
    assert shown.fragment == f"#cases?case={second}"
    shown.page.keyboard.press("p")
    assert shown.fragment == f"#cases?case={first}"
    shown.page.keyboard.press("Escape")
    assert shown.page.locator(".detail").count() == 0
    shown.page.get_by_label("Text").focus()
    shown.page.keyboard.press("n")
    assert "case=" not in shown.fragment
    assert shown.complaints == []


def test_parts_are_folded_until_their_link_is_followed(browser: Any, page: Path) -> None:
    shown = Shown(browser, page)
    breakdowns = shown.page.locator("#breakdowns table").first
    assert not breakdowns.is_visible()
    shown.page.get_by_role("navigation").get_by_role("link", name="Breakdowns").click()
    breakdowns.wait_for()
    assert Shown(browser, page, "#breakdowns").page.locator("#breakdowns table").first.is_visible()


def test_every_table_has_heads_with_a_scope(browser: Any, page: Path) -> None:
    shown = Shown(browser, page, f"#cases?case={FIRST.item_id}")
    assert shown.page.locator("th:not([scope])").count() == 0
    assert shown.page.evaluate("[...document.querySelectorAll('table')].every((t) => t.querySelector('th'))")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_text_stands_out_from_its_background(browser: Any, page: Path, dark: bool) -> None:
    """At least 4.5 to 1, as WCAG 2.1 asks for (success criterion 1.4.3)."""
    shown = Shown(browser, page, f"#cases?case={FIRST.item_id}", dark=dark)
    assert shown.page.evaluate(_LOW_CONTRAST) == []


_LOW_CONTRAST = """() => {
  const unit = (color) => (color.startsWith("color(") ? 255 : 1);
  const channels = (color) =>
    color.match(/[\\d.]+/g).map((part, place) => Number(part) * (place < 3 ? unit(color) : 1));
  const linear = (c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  const luminance = (color) =>
    channels(color).slice(0, 3).reduce((sum, c, i) => sum + linear(c / 255) * [0.2126, 0.7152, 0.0722][i], 0);
  const backs = new Map([[null, "rgb(255, 255, 255)"]]);
  const behind = (place) => {
    if (!backs.has(place)) {
      const color = getComputedStyle(place).backgroundColor;
      backs.set(place, (channels(color)[3] ?? 1) > 0 ? color : behind(place.parentElement));
    }
    return backs.get(place);
  };
  const weak = [];
  for (const place of document.querySelectorAll("body *:not(svg, svg *, script, option)")) {
    const own = [...place.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    if (!own || place.disabled || !place.checkVisibility()) continue;
    const [a, b] = [luminance(getComputedStyle(place).color), luminance(behind(place))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) weak.push(`${ratio.toFixed(2)} ${place.outerHTML.slice(0, 120)}`);
  }
  return weak;
}"""
