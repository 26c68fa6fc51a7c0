from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.substrates.embedded.catalogue.floorplan import (
    Footprint,
    extent,
    floorplan,
    footprint_at,
    spot_of,
)
from pytest_libero_max.tasks.libero_tasks import SUITES, task

TASKS = [(suite, index) for suite in SUITES for index in range(10)]
rectangles = st.builds(
    Footprint,
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
    half_x=st.floats(0.01, 0.3),
    half_y=st.floats(0.01, 0.3),
    yaw=st.floats(-4, 4),
)


def inside(one: Footprint, x: float, y: float) -> bool:
    c, s = math.cos(one.yaw), math.sin(one.yaw)
    dx, dy = x - one.x, y - one.y
    return abs(c * dx + s * dy) <= one.half_x and abs(c * dy - s * dx) <= one.half_y


@given(rectangles, rectangles, st.floats(-1, 1), st.floats(-1, 1))
def test_rectangles_that_share_a_point_have_no_gap(
    one: Footprint, other: Footprint, u: float, v: float
) -> None:
    c, s = math.cos(one.yaw), math.sin(one.yaw)
    x = one.x + c * u * one.half_x - s * v * one.half_y
    y = one.y + s * u * one.half_x + c * v * one.half_y
    if inside(other, x, y):
        assert one.gap(other) <= 1e-9
        assert other.gap(one) == pytest.approx(one.gap(other))


def test_the_gap_between_squares_side_by_side() -> None:
    one = Footprint(0.0, 0.0, 0.1, 0.1)
    assert one.gap(Footprint(0.5, 0.0, 0.1, 0.1)) == pytest.approx(0.3)
    assert one.gap(Footprint(0.5, 0.0, 0.1, 0.1, slack=0.05)) == pytest.approx(0.25)
    assert one.gap(Footprint(0.0, 0.5, 0.1, 0.1, math.pi / 2)) == pytest.approx(0.3)


def test_the_gap_between_discs_and_squares() -> None:
    disc = Footprint(0.0, 0.0, 0.1, 0.1, round=True)
    assert disc.gap(Footprint(0.5, 0.0, 0.1, 0.1, round=True)) == pytest.approx(0.3)
    assert disc.gap(Footprint(0.3, 0.3, 0.1, 0.1)) == pytest.approx(math.hypot(0.2, 0.2) - 0.1)
    assert Footprint(0.3, 0.3, 0.1, 0.1, 1.0).gap(disc) == disc.gap(Footprint(0.3, 0.3, 0.1, 0.1, 1.0))
    assert disc.gap(Footprint(0.0, 0.0, 0.3, 0.2)) == pytest.approx(-0.3)


def test_what_starts_at_any_angle_takes_the_room_of_all_of_them() -> None:
    book = floorplan("libero_10", 5).standing["black_book_1"]
    assert book.round
    assert book.half_x == pytest.approx(math.hypot(0.0148, 0.0673), abs=0.002)


def test_a_rider_is_where_its_region_is() -> None:
    x, y = spot_of(task("libero_spatial", 7), "akita_black_bowl_1")
    assert (x, y) == pytest.approx((-0.26, -0.14), abs=0.01)
    assert spot_of(task("libero_spatial", 3), "akita_black_bowl_1") == pytest.approx((0.07, 0.03))
    assert spot_of(task("libero_spatial", 3), "plate_1") == pytest.approx((0.06, 0.20))


def test_extents_are_those_of_the_things() -> None:
    low_x, high_x, low_y, high_y = extent("plate")
    assert (high_x - low_x, high_y - low_y) == pytest.approx((0.138, 0.138), abs=0.006)
    shut, opened = extent("wooden_cabinet"), extent("wooden_cabinet", frozenset({"top_region"}))
    assert opened[2] == pytest.approx(shut[2] - 0.16, abs=0.01)
    assert opened[:2] == pytest.approx(shut[:2])


@pytest.mark.parametrize(("suite", "index"), TASKS)
def test_everything_that_stands_free_stands_apart(suite: str, index: int) -> None:
    plan = floorplan(suite, index)
    known = {*plan.task.objects, *plan.task.fixtures}
    assert {*plan.standing, *plan.carried} == known
    assert not set(plan.standing) & set(plan.carried)
    for name, footprint in plan.standing.items():
        x, y = plan.centre(name)
        assert inside(footprint, x, y)
        # Boxes around round things overlap by their corners, more so with the room that their starts take.
        assert plan.gap(footprint, [name]) > -0.06


def test_riders_are_found_with_what_rides_on_them() -> None:
    plan = floorplan("libero_spatial", 3)
    assert plan.riders("cookies_1") == ("akita_black_bowl_1",)
    assert plan.carrier("akita_black_bowl_1") == "cookies_1"
    assert plan.carrier("plate_1") == "plate_1"


def test_a_place_outside_is_outside() -> None:
    plan = floorplan("libero_spatial", 0)
    assert plan.inside(footprint_at("milk", 0.1, 0.0))
    assert not plan.inside(footprint_at("milk", 0.5, 0.0))
    assert plan.in_view(footprint_at("milk", 0.0, 0.0))
    assert not plan.in_view(footprint_at("milk", 0.3, 0.4))
    assert plan.reachable(0.1, 0.0)
    assert not plan.reachable(0.2, 0.0)
