from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from msgspec import structs

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.comparison.compare import compare_runs
from pytest_libero_max.report.formats import percent
from pytest_libero_max.report.gate_results import decide_on
from pytest_libero_max.report.gate_text import gate_rows
from pytest_libero_max.report.gates import parse_gates
from pytest_libero_max.report.page.report_page import html
from pytest_libero_max.report.page.words import explained
from pytest_libero_max.report.render.drawing import drawn
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.run_document import markdown
from pytest_libero_max.report.run_plots import base_to_dynamic, forest
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.writers.report_files import all_figures, write_figures
from tests.report.made_up import NEVER_TRIGGERED, PROVENANCE, error_of, plan, record_of, records_of, run_of
from tests.report.svg_frame import SVG, parsed_inside

PAIRS = plan(per_cell=2)
RECORDS = records_of(PAIRS)
FULL = build_report(RECORDS, [], PAIRS, PROVENANCE)
PARTIAL = build_report(RECORDS[3:], [error_of(PAIRS[0])], PAIRS, PROVENANCE)
EMPTY = build_report([], [error_of(pair) for pair in PAIRS], PAIRS, PROVENANCE)
ALIKE = build_report(
    [record_of(pair, False, False, **NEVER_TRIGGERED) for pair in PAIRS], [], PAIRS, PROVENANCE
)
REPORTS = {"full": FULL, "partial": PARTIAL, "empty": EMPTY, "alike": ALIKE}
REPLAY = ["pytest", "--libero-max-policy=a.py", "-k"]


class _Balance(HTMLParser):
    """Fails on a tag that is closed wrongly or never."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in ("meta", "img", "wbr"):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("name", REPORTS)
def test_a_page_is_whole_and_needs_no_network(name: str) -> None:
    page = html(REPORTS[name], ["item"], REPLAY)
    parser = _Balance()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    assert not re.search(r"<script|<link|url\(|src=", page)  # without a run there is no table of its cases
    links = set(re.findall(r"href='([^']*)'", page))
    assert {link for link in links if not link.startswith("#")} <= {"pairs.jsonl"}
    assert all(f"id='{link[1:]}'" in page for link in links if link.startswith("#"))
    assert set(re.findall(r"https?://[^'\"<\s]*", page)) <= {"http://www.w3.org/2000/svg"}
    assert "nan" not in re.sub(r"[Pp]rovenance|font[^;}]*", "", page)
    assert "None" not in page


def test_a_page_says_what_is_wrong_first() -> None:
    page = html(PARTIAL, [], REPLAY)
    assert page.index("INCOMPLETE: 61 of 64") < page.index("Base success")
    assert PARTIAL.pairs.invalid_pairs[0].message in page
    assert "Missing pairs" in page
    assert "INCOMPLETE" not in html(FULL, [], REPLAY)


def _first_screen(report: Report) -> str:
    page = html(report, [], REPLAY)
    return page[page.index("<header>") : page.index("<div class='sections'>")]


def test_pairs_that_cannot_show_the_event_have_no_change_on_the_first_screen() -> None:
    screen = _first_screen(ALIKE)
    assert "Not measurable" in screen
    assert "0.0 pp" not in screen
    assert "class='plot'" not in screen
    assert "Not measurable" not in _first_screen(FULL)


def test_the_first_screen_says_when_and_how_without_letters() -> None:
    git = {"commit": "c" * 40, "dirty": True}
    origin = {**PROVENANCE, "started": "2026-05-01T12:30:00+00:00", "git": git}
    screen = _first_screen(structs.replace(FULL, provenance=origin))
    for fact in ("64 of 64 planned pairs played", "2026-05-01", f"commit {'c' * 12} with changes"):
        assert f"<li>{fact}</li>" in screen
    assert [*map(screen.count, ("10 actions a query", "5 of them"))] == [1, 1]
    assert not re.search(r"\b[HQ]=", screen)


def test_a_run_without_a_played_pair_has_no_empty_tables_or_plots() -> None:
    page = html(EMPTY, [], REPLAY)
    titles = [re.sub("<[^>]*>", "", title) for title in re.findall(r"<h2>.*?</h2>", page)]
    assert titles == ["Invalid pairs", "Provenance", "Words", LIMITS_TITLE]
    assert not re.search(r"class='(plot|heat|histogram|bar)", page)
    assert "#breakdowns" not in page


def test_why_no_interval_by_task_exists_is_said_once() -> None:
    page = html(FULL, [], REPLAY)
    assert page.count("too few tasks") == 1


def test_words_that_need_their_meaning_have_it_where_they_stand() -> None:
    assert str(explained("Stale & stale actions")).startswith("Stale &amp; <abbr title='")
    assert explained("<b>") == "&lt;b&gt;"


def test_a_page_lists_regressions_with_the_way_to_see_them() -> None:
    page = html(FULL, ["first", "second"], REPLAY)
    assert "<code>pytest --libero-max-policy=a.py -k NAME</code>" in page
    assert "<li><code>second</code></li>" in page


def test_a_page_links_the_film_of_each_pair_that_has_one() -> None:
    films = {"second": ["films/second--base dynamic.mp4"], "third": ["films/third--base.webp"]}
    page = html(FULL, ["first", "second"], REPLAY, films)
    assert "<li><code>first</code></li>" in page
    assert "<li><code>second</code> <a href='films/second--base%20dynamic.mp4'>film</a></li>" in page
    assert "Films of 1" in page
    assert "<li><code>third</code> <a href='films/third--base.webp'>film</a></li>" in page
    assert "Films of" not in html(FULL, ["first"], REPLAY)


def test_a_page_and_markdown_show_each_gate_with_its_verdict_in_the_unit_of_the_gate() -> None:
    stored = run_of(PAIRS, RECORDS)
    gates = parse_gates(["base_sr >= 1%", "delta.upper <= -90%", "delta.lower >= -1%", "p_value_vs(no) > 1%"])
    rows = gate_rows(decide_on(gates, stored, FULL, Path()))
    assert [row.finding for row in rows] == ["holds", "violated", "not shown", "open"]
    base, change = FULL.overall.base_success, FULL.overall.paired_change
    assert [row.value for row in rows] == [*map(percent, (base.value, change.upper, change.lower)), "n/a"]
    page = html(FULL, [], REPLAY, gates=rows)
    first_screen = page[page.index("<body>") : page.index("Source categories")].replace("<wbr>", "")
    for row in rows:
        kind = row.finding.replace(" ", "-")
        assert re.search(rf"<b class='{kind}'>{row.finding}</b>\s*<(span|details)>", first_screen)
        assert f"<code>{row.gate.replace('>', '&gt;').replace('<', '&lt;')}</code> <b>{row.value}</b>" in page
        assert f"| **{row.finding}** | {row.value} |" in markdown(FULL, {}, rows)
    lost = [record.item_id for record in RECORDS if record.outcome == "regression"]
    assert f"<span data-view='case={lost[0]}'>{lost[0]}</span> and {len(lost) - 1} more." in first_screen
    assert "class='gates'" not in html(FULL, [], REPLAY)


def test_what_others_wrote_is_escaped() -> None:
    policy = {**RECORDS[0].policy, "name": "<b>bold</b>"}
    report = build_report(
        [record_of(pair, True, True, policy=policy) for pair in PAIRS], [], PAIRS, PROVENANCE
    )
    page = html(report, ["<i>"], REPLAY)
    assert "<b>bold" not in page
    assert "&lt;b&gt;bold" in page
    assert "<i>" not in page


@pytest.mark.parametrize("name", REPORTS)
def test_every_figure_is_well_formed_and_inside_its_frame(name: str) -> None:
    for svg in all_figures(REPORTS[name]).values():
        parsed_inside(svg)


def test_a_line_goes_from_base_to_dynamic() -> None:
    pairs = [pair for pair in PAIRS if pair.event == "camera_shift"]
    records = [record_of(pair, True, index % 2 == 0) for index, pair in enumerate(pairs)]
    plot = base_to_dynamic(build_report(records, [], pairs, PROVENANCE))
    assert [row.span for row in plot.rows] == [(1.0, 0.5, "loss")] * 2
    root = parsed_inside(drawn(plot))
    lines = [shape.attrib for shape in root.iter(f"{SVG}line") if shape.get("stroke-width") == "2.5"]
    dots = [float(shape.attrib["cx"]) for shape in root.iter(f"{SVG}circle")]
    assert [float(line[end]) for line in lines for end in ("x1", "x2")] == dots
    assert dots[0] - dots[1] == pytest.approx(210)


def test_figures_are_written_as_files(tmp_path: Path) -> None:
    paths = write_figures(FULL, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    assert (tmp_path / "paired-change.svg").read_text() == drawn(forest(FULL))


def test_the_first_screen_says_what_changed_since_an_earlier_run() -> None:
    runs = {
        name: run_of(PAIRS, (record_of(pair, True, index >= lost) for index, pair in enumerate(PAIRS)))
        for name, lost in (("out/before", 2), ("out/after", 9))
    }
    report = build_report(runs["out/after"].records, [], PAIRS, PROVENANCE)
    page = html(report, [], REPLAY, earlier=compare_runs(runs))
    assert re.search(r"Since before: .* -10\.9 pp \[.*\], 7 cases .* 0 won of 64\.", page)
    assert "Since before" not in html(report, [], REPLAY)
