from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.errors import SubstrateError
from pytest_libero_max.substrates.libero.placing import (
    objects,
    offsets,
    overlapping,
    pressed,
    put_where_free,
    radius,
    require_free,
    shifts,
)
from pytest_libero_max.substrates.libero.substrate import LiberoSubstrate
from tests.substrates.libero.data import needs_package

plane = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)).filter(lambda xy: math.hypot(*xy) > 0.01)


@given(requested=plane, shortest=st.floats(0.0, 0.3))
def test_a_shift_begins_with_the_requested_direction_and_is_never_too_short(
    requested: tuple[float, float], shortest: float
) -> None:
    found = shifts(requested, shortest)
    length = max(math.hypot(*requested), shortest)
    assert np.allclose(found[0], np.array(requested) / math.hypot(*requested) * length)
    assert len(found) <= 32
    assert min(math.hypot(*shift) for shift in found) >= shortest - 1e-9
    assert len({tuple(np.round(shift, 4)) for shift in found}) == len(found)


@given(requested=plane)
def test_an_offset_begins_with_the_requested_one_and_fans_out_in_front(
    requested: tuple[float, float],
) -> None:
    found = offsets(requested, (1.0, 0.0))
    assert tuple(found[0]) == requested
    assert len(found) <= 32
    widest = 1.2 + 0.48  # the widest direction that is kept, and half the fan
    assert all(abs(math.atan2(offset[1], offset[0])) <= widest + 1e-9 for offset in found[1:])


def test_candidates_come_in_the_published_order() -> None:
    """Radii outside, angles inside; the last ones are cut off."""
    found = shifts((0.1, 0.0), 0.0)
    assert np.allclose(found[:4], [(0.1, 0.0), (0.0, 0.1), (0.0, -0.1), (-0.1, 0.0)])
    assert np.allclose(found[8], (0.09, 0.0))
    assert np.allclose(found[16], (0.11, 0.0))
    found = offsets((0.08, 0.0), (1.0, 0.0))
    assert np.allclose(found[1], (0.12, 0.0))
    assert np.allclose(found[2], (0.12 * math.cos(0.16), -0.12 * math.sin(0.16)))
    assert np.allclose(found[8], (0.16, 0.0))
    assert np.allclose(found[22], (0.075, 0.0))


@needs_package
def test_a_place_is_free_of_circles_and_of_pressure(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_object", 0, 195)
    world.varied(None).reset(0)
    assert set(objects(world)) == {name for name, entity in world.entities.items() if entity.kind == "object"}
    assert overlapping(world) == []
    soup, milk = world.pose("alphabet_soup_1"), world.position("milk_1")
    beside = radius(world, "alphabet_soup_1") + radius(world, "milk_1") + 0.005
    world.place("alphabet_soup_1", (milk[0] + beside, milk[1], milk[2]))
    assert overlapping(world) == [("alphabet_soup_1", "milk_1")]
    with pytest.raises(SubstrateError, match="alphabet_soup_1 and milk_1"):
        require_free(world, "alphabet_soup_1")
    world.place("alphabet_soup_1", milk)
    assert pressed(world, "alphabet_soup_1")
    world.place("alphabet_soup_1", *soup)
    world.place("alphabet_soup_1", (soup[0][0], soup[0][1], 0.0))
    assert not pressed(world, "alphabet_soup_1"), "the floor does not count"


@needs_package
def test_the_first_free_place_is_taken_and_none_is_an_error(substrate: LiberoSubstrate) -> None:
    world = substrate.task_world("libero_object", 0, 195)
    world.varied(None).reset(0)
    before = world.pose("alphabet_soup_1")
    milk, outside = world.position("milk_1")[:2], np.array((0.7, 0.0))
    with pytest.raises(SubstrateError, match="'alphabet_soup_1'; it tries 2"):
        put_where_free(world, "alphabet_soup_1", [milk, outside], before)
    assert np.array_equal(np.concatenate(world.pose("alphabet_soup_1")), np.concatenate(before))
    free, other = np.array((0.4, 0.4)), np.array((0.4, -0.4))
    put_where_free(world, "alphabet_soup_1", [milk, outside, free, other], before)
    assert tuple(world.position("alphabet_soup_1")) == (*free, before[0][2])
    put_where_free(world, "alphabet_soup_1", [free, other], before, suits=lambda place: place[1] < 0.0)
    assert tuple(world.position("alphabet_soup_1")[:2]) == tuple(other)
