from __future__ import annotations

import pytest

from pytest_libero_max.benchmark.sampling import shard
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import OptionError


@pytest.mark.parametrize("count", [1, 2, 7, 64])
def test_parts_are_all_cases_each_once_and_cost_the_same(count: int) -> None:
    cases = load_track("lite").cases
    parts = [shard(cases, index, count) for index in range(1, count + 1)]
    assert sorted(case.case_id for part in parts for case in part) == sorted(case.case_id for case in cases)
    costs = [sum(case.budget for case in part) for part in parts]
    dearest = max(case.budget for case in cases)
    assert max(costs) - min(costs) <= 2 * dearest


def test_a_part_is_a_block_with_every_event_and_variant() -> None:
    cases = load_track("lite").cases
    kinds = {(case.event.name, case.event.variant) for case in cases}
    parts = [shard(cases, index, 4) for index in range(1, 5)]
    assert all({(case.event.name, case.event.variant) for case in part} == kinds for part in parts)
    assert [case for part in parts for case in part] == sorted(cases, key=lambda case: case.item_id)


@pytest.mark.parametrize("index", range(1, 6))
def test_more_parts_than_cases_are_refused_whichever_is_asked_for(index: int) -> None:
    with pytest.raises(OptionError, match="2 pairs cannot be 5"):
        shard(load_track("smoke").cases[:2], index, 5)
