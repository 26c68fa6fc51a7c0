from __future__ import annotations

from collections import Counter

import pytest

from pytest_libero_max.benchmark.order import Order
from pytest_libero_max.benchmark.tracks import load_track


def test_sorted_is_the_default_and_keeps_scenes_together() -> None:
    cases = load_track("smoke").cases
    assert Order.parse("sorted") == Order()
    assert Order().of(reversed(cases)) == tuple(sorted(cases, key=lambda case: case.item_id))


def test_blocks_are_a_permutation_that_the_seed_alone_decides() -> None:
    cases = load_track("smoke").cases
    order = Order.parse("blocks:7")
    assert str(order) == "blocks:7"
    played = order.of(cases)
    assert order.of(reversed(cases)) == played
    assert sorted(case.case_id for case in played) == sorted(case.case_id for case in cases)
    assert Order(8).of(cases) != played
    assert [case.case_id for case in played[:3]] == [
        case.case_id for case in Order(7).of(list(played[3:]) + list(played[:3]))[:3]
    ]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_prefix_is_balanced(seed: int) -> None:
    cases = load_track("lite").cases
    played = Order(seed).of(cases)
    events = Counter(case.event.name for case in cases)
    cells = Counter((case.event.name, case.suite) for case in cases)
    for length in range(1, len(played) + 1):
        share = length / len(played)
        prefix = played[:length]
        for event, count in Counter(case.event.name for case in prefix).items():
            assert abs(count - share * events[event]) <= 1.5
        for cell, count in Counter((case.event.name, case.suite) for case in prefix).items():
            assert abs(count - share * cells[cell]) <= 2.5


def test_a_part_of_the_cases_keeps_their_proportions() -> None:
    cases = [
        case for case in load_track("lite").cases if case.event.name != "camera_shift" or case.case_id < "m"
    ]
    events = Counter(case.event.name for case in cases)
    half = Counter(case.event.name for case in Order(3).of(cases)[: len(cases) // 2])
    assert all(abs(half[event] - count / 2) <= 1.5 for event, count in events.items())


@pytest.mark.parametrize("text", ["blocks", "blocks:", "blocks:x", "sorted:1", "random", ""])
def test_other_orders_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="sorted, blocks:SEED"):
        Order.parse(text)
