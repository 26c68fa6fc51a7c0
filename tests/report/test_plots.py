from __future__ import annotations

import pytest
from msgspec import structs

from pytest_libero_max.report.build import build_report
from pytest_libero_max.report.page.report_page import broken_cards
from pytest_libero_max.report.plots import Histogram, direction, outcome_bar
from pytest_libero_max.report.report_document import ChangedPair, Report
from pytest_libero_max.report.run_plots import category_map, forest
from tests.report.made_up import PROVENANCE, plan, record_of

PAIRS = plan(per_cell=4)


def _report(lost: str = "camera_shift", missing: int = 0) -> Report:
    """Every pair succeeds but those of an event, which lose; the first ones are missing."""
    records = [record_of(pair, True, pair.event != lost) for pair in PAIRS[missing:]]
    return build_report(records, [], PAIRS, PROVENANCE)


def test_a_forest_has_all_pairs_first_then_the_lowest_event() -> None:
    report = _report(missing=1)
    plot = forest(report)
    names = [str(row.name) for row in plot.rows]
    assert names[:2] == ["all pairs", "camera_shift"]
    assert len(names) == 9
    assert (plot.rows[0].note, plot.rows[1].note) == ("127/128", "16")
    assert [label for _, label in plot.axis.ticks] == ["-100", "-75", "-50", "-25", "0", "+25"]
    assert plot.axis.at(0) == 80.0
    lost = plot.rows[1]
    assert lost.dots == [(-1.0, "loss")]
    assert lost.span is not None
    assert lost.span[0] == -1.0 < lost.span[1] < 0
    assert lost.text.startswith("16/16 lost, -100.0 [-100.0, ")
    assert {row.dots[0] for row in plot.rows[2:]} == {(0.0, "neutral")}


def test_an_event_that_loses_all_of_few_pairs_is_red_beside_a_grey_interval() -> None:
    few = [pair for pair in PAIRS if pair.source == "pro"][::4]
    records = [record_of(pair, True, pair.event != "camera_shift") for pair in few]
    lost = forest(build_report(records, [], few, PROVENANCE)).rows[1]
    assert lost.text.startswith("2/2 lost, ")
    assert lost.dots == [(-1.0, "loss")]
    assert lost.span is not None
    assert lost.span[2] == "neutral"


def test_gains_stand_beside_what_was_lost() -> None:
    records = [record_of(pair, index % 2 == 0, True) for index, pair in enumerate(PAIRS)]
    plot = forest(build_report(records, [], PAIRS, PROVENANCE))
    assert plot.rows[0].text.startswith("0/64 lost, 64 gained, +")


def test_a_forest_of_nothing_has_no_dots() -> None:
    empty = build_report([], [], PAIRS, PROVENANCE)
    plot = forest(empty)
    assert {(row.text, len(row.dots), row.span) for row in plot.rows} == {("n/a", 0, None)}


def test_red_and_blue_are_for_intervals_without_zero() -> None:
    change = _report().overall.paired_change
    assert direction(change) == "loss"
    assert direction(structs.replace(change, lower=0.01, upper=0.2)) == "gain"
    assert direction(structs.replace(change, upper=0.0)) == "neutral"
    assert direction(structs.replace(change, lower=None, upper=None)) == "neutral"


def test_a_bar_of_outcomes_is_as_wide_as_its_parts() -> None:
    parts = outcome_bar(_report().overall.outcomes)
    assert sum(part.width for part in parts) == pytest.approx(100)
    assert {part.outcome: part.pairs for part in parts if part.pairs} == {
        "preserved_success": 112,
        "regression": 16,
    }


def test_a_map_has_a_cell_for_every_category_and_event() -> None:
    plot = category_map(_report())
    events = plot.columns
    for category, cells in plot.rows:
        assert len(cells) == len(events) == 8
        for event, cell in zip(events, cells, strict=True):
            assert cell is not None
            assert cell.view == f"category={category.text}&event={event}"
            lost = ("-100", "loss", 50) if event == "camera_shift" else ("0", "gain", 0)
            assert (cell.text, cell.kind, cell.weight) == lost
    few = [pair for pair in PAIRS if pair.event == "camera_shift" or pair.source == "pro"]
    report = build_report([record_of(pair, True, True) for pair in few], [], few, PROVENANCE)
    assert None in [cell for _, cells in category_map(report).rows for cell in cells]


def test_a_histogram_has_every_number_and_labels_where_there_is_room() -> None:
    def bars(counts: dict[str, int]) -> list[tuple[str, int, float]]:
        return Histogram.of("pairs", "number", counts).bars

    assert bars({"0": 2, "3": 4}) == [("0", 2, 50.0), ("1", 0, 0.0), ("2", 0, 0.0), ("3", 4, 100.0)]
    labels = [label for label, _, _ in bars({"40": 1})]
    assert [label for label in labels if label] == [str(4 * place) for place in range(11)]
    assert bars({}) == [("0", 0, 0.0)]


def test_what_broke_is_a_card_for_each_cause_and_event_with_a_film_where_one_is() -> None:
    report = _report()
    names = [pair.item_id for pair in report.changed_pairs]
    changed = [
        structs.replace(pair, cause="missed_moved_goal" if place else "grasp_slipped", sentence=f"S{place}.")
        for place, pair in enumerate(report.changed_pairs)
    ]
    gained = ChangedPair(
        item_id="other", event="camera_shift", outcome="change_associated_success", cause="not_recorded",
        sentence="The record holds no stages.",
    )  # fmt: skip
    report = structs.replace(report, changed_pairs=[*changed, gained])
    pair = next(pair for pair in PAIRS if pair.item_id == names[3])
    record = record_of(pair, True, False)
    trigger = record.trigger
    assert trigger is not None
    other = structs.replace(record.arms["dynamic"], policy={**record.policy, "name": "nurse"})
    record = structs.replace(record, arms={**record.arms, "dynamic": other})
    lost, won = broken_cards(report, {names[3]: [f"a b/{names[3]}--base-dynamic.mp4"]}, {names[3]: record})
    assert "16 of 128" in lost.part.title
    first, second = lost.cards
    assert (first.number, first.cause, first.what) == (15, "missed moved goal", "camera_shift")
    begins = trigger.step / 20 + 0.1
    assert (first.film, first.sentence) == (f"a%20b/{names[3]}--base-dynamic.mp4#t={begins:g}", "S3.")
    assert first.arms == ["Base", "Dynamic (nurse)"]
    assert first.view == "event=camera_shift&outcome=regression&cause=missed_moved_goal"
    assert first.case == f"{first.view}&case={names[3]}"
    assert (second.number, second.film, second.sentence) == (1, "", "S0.")
    (card,) = won.cards
    assert (card.cause, card.sentence) == ("", "")
    assert card.view == "event=camera_shift&outcome=change_associated_success"
    assert (lost.more, won.more) == (0, 0)


def test_small_groups_are_counted_below_the_cards() -> None:
    pairs = [
        ChangedPair(
            item_id=f"{cause}-{k}",
            event="camera_shift",
            outcome="regression",
            cause=f"c{cause}",
            sentence="S.",
        )
        for cause in range(10)
        for k in range(10 - cause)
    ]
    (section,) = broken_cards(structs.replace(_report(), changed_pairs=pairs), {}, {})
    assert [card.number for card in section.cards] == [10, 9, 8, 7, 6, 5, 4, 3]
    assert section.more == 2 + 1
