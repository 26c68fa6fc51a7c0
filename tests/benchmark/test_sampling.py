from collections import Counter
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.manifests import Manifest
from pytest_libero_max.benchmark.sampling import stratified
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.errors import OptionError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.worlds.contract import Entity

ENTITIES = {
    name: Entity(name, "thing", "object", f"{name}_main", support="main_table")
    for name in ("mug_1", "plate_1", "jar_1")
}
SMOKE = load_track("smoke").cases


@given(strategies.manifests(ENTITIES), st.integers(1, 8), st.randoms())
def test_a_subset_does_not_depend_on_the_order_of_the_cases(
    manifest: Manifest, limit: int, random: Random
) -> None:
    shuffled = list(manifest.cases)
    random.shuffle(shuffled)
    chosen, again = stratified(manifest.cases, limit), stratified(shuffled, limit)
    assert {case.case_id for case in chosen} == {case.case_id for case in again}
    assert len(chosen) == min(limit, len(manifest))
    assert [case for case in manifest if case in chosen] == list(chosen)


@given(st.integers(1, 31))
def test_a_larger_limit_only_adds_cases(limit: int) -> None:
    assert set(stratified(SMOKE, limit)) < set(stratified(SMOKE, limit + 1))


@given(st.integers(1, 32))
def test_counts_differ_by_one_at_most(limit: int) -> None:
    chosen = stratified(SMOKE, limit)
    events = Counter(dict.fromkeys(BENCHMARK_EVENTS, 0))
    events.update(case.event.name for case in chosen)
    assert max(events.values()) - min(events.values()) <= 1
    cells = Counter((case.event.name, case.event.variant) for case in chosen)
    assert max(cells.values()) <= -(-limit // 16)


def test_eight_cases_are_the_eight_events_half_of_each_variant() -> None:
    chosen = stratified(SMOKE, 8)
    assert {case.event.name for case in chosen} == set(BENCHMARK_EVENTS)
    assert Counter(case.event.variant for case in chosen) == {0: 4, 1: 4}
    suites = Counter(case.suite for case in chosen)
    assert abs(suites["libero_spatial"] - suites["libero_object"]) <= 2


def test_four_cases_are_of_the_four_families() -> None:
    assert len({case.event.family_code for case in stratified(SMOKE, 4)}) == 4
    assert set(stratified(SMOKE, 4)) < set(stratified(SMOKE, 8))


def test_all_are_enough() -> None:
    assert stratified(SMOKE, 32) == SMOKE
    assert stratified(SMOKE, 1000) == SMOKE


@pytest.mark.parametrize("limit", [0, -3])
def test_a_limit_below_one_is_refused(limit: int) -> None:
    with pytest.raises(OptionError, match=f"limit={limit}, "):
        stratified(SMOKE, limit)
