"""A pair in three dimensions in a real browser, on an embedded scene: drawn, scrubbed, turned, and small."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.films.recorded import pose_pair
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.trace import traces_of
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.report.page.scenes import MOST_CHARACTERS, scenes_of
from pytest_libero_max.report.writers.report_files import write_reports
from pytest_libero_max.runs.plan import Run
from pytest_libero_max.runs.store import PairStore
from pytest_libero_max.substrates.registry import open_substrate
from tests.report.made_up import PROVENANCE
from tests.report.page.browser import Shown, open_browser

DRIVER_NOTE = "GPU stall due to ReadPixels"
"""What the browser says of a picture that is taken of a canvas."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as browser:
        yield browser


class Posed:
    """A run of one embedded pair with its poses: the cup that the policy reaches for moves."""

    def __init__(self, folder: Path) -> None:
        case = make_case("target_relocation", "libero_spatial", 2, variant=1)
        substrate = open_substrate("embedded")
        try:
            world = substrate.world(case)
            policy = load_policy("stale_expert")
            pair = measure_pair(case, world, policy, PairSettings(films=True))
            self.record, self.traces = pair.record, traces_of(pair)
            self.item = pair.record.item_id
            pose_pair(folder / "poses" / f"{self.item}.npz", case, world, pair.record, self.traces)
        finally:
            substrate.close()
        pairs = PairStore(folder, Run.of([case], PROVENANCE))
        pairs.append(pair.record)
        pairs.close()
        write_reports(folder)
        self.folder = folder


@pytest.fixture(scope="module")
def posed(tmp_path_factory: pytest.TempPathFactory) -> Posed:
    return Posed(tmp_path_factory.mktemp("posed"))


def _open(browser: Any, posed: Posed, **how: Any) -> Shown:
    shown = Shown(browser, posed.folder / "report.html", f"#cases?case={posed.item}", **how)
    shown.page.evaluate("document.querySelector('.scene').shown.ready")
    return shown


NEXT_DRAWING = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def _pixels(shown: Shown) -> NDArray[np.int16]:
    png = shown.page.locator(".scene canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=np.int16)


def _go_to(shown: Shown, step: int) -> None:
    seek = shown.page.get_by_role("slider", name="Policy step")
    seek.evaluate(f"(input) => {{ input.value = {step}; input.dispatchEvent(new Event('input')); }}")
    shown.page.locator(f".scene canvas[data-step='{step}']").wait_for()


def _position(shown: Shown, arm: str, step: int) -> NDArray[np.float64]:
    """Position of the trigger entity, m, as the viewer places it."""
    return np.array(
        shown.page.evaluate(
            """([arm, entity, step]) => {
              const { scene } = document.querySelector(".scene").shown;
              const body = scene.bodies.findIndex(([name]) => name === entity);
              return scene.pose(scene.arms.find(({ name }) => name === arm), body, step).slice(0, 3);
            }""",
            [arm, "akita_black_bowl_1", step],
        )
    )


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_both_arms_are_drawn_and_the_page_fits(browser: Any, posed: Posed, width: int, dark: bool) -> None:
    shown = _open(browser, posed, width=width, dark=dark)
    assert shown.too_wide() == []
    picture = _pixels(shown)
    axis = 1 if width > 700 else 0  # beside each other, or below
    halves = np.array_split(picture, 2, axis=axis)
    for half in halves:
        assert len(np.unique(half.reshape(-1, 3), axis=0)) > 500, "an arm is not drawn"
    labels = shown.page.locator(".scene .arms div").all_inner_texts()
    assert [label.split(",")[0] for label in labels] == ["base", "dynamic"]
    assert [text for text in shown.complaints if DRIVER_NOTE not in text] == []


def test_a_thing_is_where_the_record_says_at_each_step(browser: Any, posed: Posed) -> None:
    shown, event = _open(browser, posed), posed.record.trigger_step
    assert event is not None
    for arm, trace in posed.traces.items():
        for step in (1, event - 1, event + 1, len(trace.entity)):
            assert np.abs(_position(shown, arm, step) - trace.entity[step - 1]).max() < 2e-4
    apart = _position(shown, "dynamic", event) - _position(shown, "base", event)
    assert np.linalg.norm(apart) == pytest.approx(0.12, abs=0.02)
    last = len(posed.traces["dynamic"].entity)
    assert np.array_equal(_position(shown, "dynamic", 10_000), _position(shown, "dynamic", last))


def test_the_scrubber_moves_the_arms_and_marks_what_the_event_moved(browser: Any, posed: Posed) -> None:
    shown, event = _open(browser, posed), posed.record.trigger_step
    assert event is not None
    _go_to(shown, event - 1)
    before = _pixels(shown)
    _go_to(shown, event)
    after, middle = _pixels(shown), before.shape[1] // 2
    yellow = np.abs(after - (201, 143, 0)).max(axis=2) < 40
    assert not yellow[30:, :middle].any()
    assert yellow[30:, middle:].sum() > 30
    assert "0 after the event" in shown.page.locator(".scene .arms").inner_text()
    _go_to(shown, event + 40)
    later = _pixels(shown)
    assert (np.abs(later - after).max(axis=2) > 20).mean() > 0.01
    assert "step" in shown.page.locator(".transport output").inner_text()


def test_arms_are_laid_over_each_other_turned_and_brought_back(browser: Any, posed: Posed) -> None:
    shown = _open(browser, posed)
    start = _pixels(shown)
    canvas = shown.page.locator(".scene canvas")
    canvas.focus()
    for _ in range(3):
        shown.page.keyboard.press("ArrowLeft")
    shown.page.evaluate(NEXT_DRAWING)
    assert (np.abs(_pixels(shown) - start).max(axis=2) > 20).mean() > 0.05
    shown.page.get_by_role("button", name="View of the camera").click()
    shown.page.evaluate(NEXT_DRAWING)
    canvas.focus()
    assert np.abs(_pixels(shown)[5:-5, 5:-5] - start[5:-5, 5:-5]).max() <= 2
    box = canvas.bounding_box()
    shown.page.mouse.move(box["x"] + 90, box["y"] + 90)
    distance = "document.querySelector('.scene').shown.distance"
    near = shown.page.evaluate(distance)
    shown.page.mouse.wheel(0, 300)
    shown.until(f"{distance} > {near}")
    far = shown.page.evaluate(distance)
    canvas.blur()
    shown.page.mouse.wheel(0, 300)  # scrolls the page
    shown.until("window.scrollY > 0")
    assert shown.page.evaluate(distance) == far
    over = shown.page.get_by_role("button", name="Over each other")
    over.click()
    assert over.get_attribute("aria-pressed") == "true"
    assert shown.page.locator(".scene .arms div").count() == 1
    assert len(np.unique(_pixels(shown).reshape(-1, 3), axis=0)) > 500


def test_without_films_the_step_goes_on_by_itself(browser: Any, posed: Posed) -> None:
    shown = _open(browser, posed)
    step = "Number(document.querySelector('.scene canvas').dataset.step)"
    before = shown.page.evaluate(step)
    shown.page.get_by_role("button", name="Play", exact=True).click()
    shown.until(f"{step} > {before} + 5")
    shown.page.get_by_role("button", name="Pause", exact=True).click()
    shown.page.get_by_role("button", name="Play", exact=True).wait_for()


def test_a_case_that_is_not_open_costs_no_context(browser: Any, posed: Posed) -> None:
    shown = Shown(browser, posed.folder / "report.html")
    assert shown.page.locator("canvas").count() == 0
    shown.page.locator(".cases th button").last.click()
    shown.page.evaluate("document.querySelector('.scene').shown.ready")
    shown.page.evaluate("window.before = document.querySelector('.scene canvas').getContext('webgl2')")
    shown.page.locator(".cases tbody th button").click()
    shown.page.locator(".cases tbody th button").click()
    shown.page.evaluate("document.querySelector('.scene').shown.ready")
    assert shown.page.evaluate("window.before.isContextLost()")


def test_eight_pairs_without_a_shape_in_common_fit_three_megabytes(posed: Posed) -> None:
    contents = scenes_of(posed.folder, [posed.item]).contents
    assert len(posed.traces["dynamic"].actions) == 220, "the longest that the suite allows"
    assert 8 * sum(map(len, contents.values())) < MOST_CHARACTERS
