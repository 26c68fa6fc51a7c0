from __future__ import annotations

import math
from collections import Counter
from unittest.mock import Mock

import numpy as np
import pytest

from pytest_libero_max.changes import change_from_dict
from pytest_libero_max.substrates.embedded.catalogue import object_layouts, plus_catalogue
from pytest_libero_max.substrates.embedded.catalogue.floorplan import Footprint, floorplan, footprint_at
from pytest_libero_max.substrates.embedded.catalogue.lookup import catalogue
from pytest_libero_max.substrates.embedded.catalogue.object_layouts import SHIFT_M_PER_LEVEL, target_of
from pytest_libero_max.substrates.embedded.catalogue.plus_catalogue import (
    DIFFICULTY,
    KINDS,
    VARIATIONS,
    plus_suite,
    plus_variation,
    start_offset,
)
from pytest_libero_max.substrates.variation import Variation, digest_of
from pytest_libero_max.tasks.libero_tasks import SUITES, task
from pytest_libero_max.tasks.sources import PLUS_CATEGORIES


def of(category: str, suite: str | None = None) -> list[Variation]:
    return [v for v in catalogue("plus") if v.category == category and suite in (None, v.suite)]


def test_there_are_10030_of_them() -> None:
    assert tuple(DIFFICULTY) == PLUS_CATEGORIES
    assert len(catalogue("plus")) == 10_030
    assert Counter(v.suite for v in catalogue("plus")) == {
        "libero_spatial": 2402,
        "libero_object": 2518,
        "libero_goal": 2591,
        "libero_10": 2519,
    }
    assert sum(v.difficulty is None for v in catalogue("plus")) == 121


@pytest.mark.parametrize("category", PLUS_CATEGORIES)
@pytest.mark.parametrize("suite", SUITES)
def test_difficulties_are_as_many_as_in_the_original(category: str, suite: str) -> None:
    counts = Counter(v.difficulty for v in of(category, suite))
    assert tuple(counts[level] for level in (1, 2, 3, 4, 5, None)) == DIFFICULTY[category][suite]


@pytest.mark.parametrize("suite", SUITES)
def test_kinds_are_as_many_as_in_the_original_for_every_task(suite: str) -> None:
    for base in range(10):
        counts = Counter(v.kind for v in plus_suite(suite) if v.base_index == base)
        assert tuple(counts[kind] for kind in KINDS) == VARIATIONS[suite][base]


def test_the_two_tables_of_counts_agree() -> None:
    columns = {
        "Background Textures": (0, 1),
        "Camera Viewpoints": (2, 3, 4),
        "Language Instructions": (5,),
        "Light Conditions": (6,),
        "Objects Layout": (7, 8),
        "Robot Initial States": (9,),
        "Sensor Noise": (10,),
    }
    for category, numbers in columns.items():
        for suite in SUITES:
            assert sum(row[n] for row in VARIATIONS[suite] for n in numbers) == sum(
                DIFFICULTY[category][suite]
            )


@pytest.mark.parametrize("suite", SUITES)
def test_the_registry_is_ordered_and_its_names_are_unique(suite: str) -> None:
    variations = plus_suite(suite)
    assert [v.index for v in variations] == list(range(len(variations)))
    order = [(PLUS_CATEGORIES.index(v.category), v.base_index) for v in variations]
    assert order == sorted(order)
    assert len({v.name for v in variations}) == len(variations)
    assert all(v.name.startswith(task(suite, v.base_index).name + "_") for v in variations)


def test_specifications_are_distinct_small_and_readable() -> None:
    for base in {(v.suite, v.base_index) for v in catalogue("plus")[::500]}:
        said = [repr((v.scene, v.changes)) for v in catalogue("plus") if (v.suite, v.base_index) == base]
        assert len(set(said)) == len(said)
    for variation in catalogue("plus")[::37]:
        assert variation.changes
        for raw in variation.changes:
            assert change_from_dict(raw).to_dict() == raw


def test_the_catalogue_is_a_pure_function() -> None:
    for cached in (plus_suite, plus_variation, plus_catalogue._ranked):
        cached.cache_clear()
    again = plus_suite("libero_spatial")
    assert digest_of(again) == digest_of(catalogue("plus")[: len(again)])


def test_one_variation_is_made_without_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = next(v for v in of("Objects Layout", "libero_goal") if v.kind == "level")
    shifted = Mock(wraps=object_layouts.shifted_objects)
    monkeypatch.setattr(object_layouts, "shifted_objects", shifted)
    plus_variation.cache_clear()
    plus_catalogue._ranked.cache_clear()
    assert plus_variation("libero_goal", wanted.index) == wanted
    shifted.assert_called_once()


def test_the_numbers_are_those_of_the_original_table() -> None:
    levels = Counter(variation.difficulty for variation in catalogue("plus"))
    assert [levels[level] for level in (1, 2, 3, 4, 5, None)] == [1644, 2202, 2094, 1886, 2083, 121]
    noise = Counter(variation.difficulty for variation in of("Sensor Noise", "libero_10"))
    assert [noise[level] for level in (1, 2, 3, 4, 5)] == [27, 97, 81, 124, 120]
    assert len(catalogue("pro")) == 400


@pytest.mark.parametrize("category", ["Robot Initial States", "Sensor Noise", "Objects Layout"])
@pytest.mark.parametrize("suite", SUITES)
def test_a_higher_level_is_never_milder(category: str, suite: str) -> None:
    def size(variation: Variation) -> float | None:
        (*_, change) = variation.changes
        if category == "Robot Initial States":
            return round(math.hypot(*change["delta_joint_rad"]), 6)
        if category == "Sensor Noise":
            return float(change["level"])
        if variation.kind == "add":
            return len(variation.changes)
        return None  # several things shifted by different lengths

    sizes = [(v.difficulty, s) for v in of(category, suite) if (s := size(v)) is not None]
    for level in (1, 2, 3, 4):
        assert max(s for d, s in sizes if d == level) <= min(s for d, s in sizes if d == level + 1)


def test_start_poses_are_liberopluss_own() -> None:
    assert [math.hypot(*start_offset(n)) for n in (0, 99, 100, 250, 499)] == pytest.approx(
        [0.1, 0.1, 0.2, 0.3, 0.5]
    )
    drawn = np.random.RandomState(42).randn(7)
    assert start_offset(0) == pytest.approx(0.1 * drawn / np.linalg.norm(drawn), abs=1e-8)


def test_added_objects_are_new_to_the_scene_and_stand_clear() -> None:
    for variation in of("Objects Layout")[::9]:
        if variation.kind != "add":
            continue
        row = task(variation.suite, variation.base_index)
        plan = floorplan(variation.suite, variation.base_index)
        taken: list[Footprint] = []
        for (instance, category), change in zip(variation.scene["extras"], variation.changes, strict=True):
            assert instance not in (*row.objects, *row.fixtures)
            assert (change["operation"], change["object"]) == ("put_object", instance)
            x, y = change["offset_xy_m"]
            footprint = footprint_at(category, x, y, math.pi / 4)
            assert plan.gap(footprint) >= 0.03
            assert all(footprint.gap(other) >= 0.03 for other in taken)
            taken.append(footprint)


def test_shifts_stay_within_their_disc_and_the_target_goes_farthest() -> None:
    for variation in of("Objects Layout")[::7]:
        if variation.kind != "level":
            continue
        plan = floorplan(variation.suite, variation.base_index)
        lengths = {raw["object"]: math.hypot(*raw["delta_position_m"]) for raw in variation.changes}
        assert all(length <= SHIFT_M_PER_LEVEL[variation.suite] * 5 + 1e-6 for length in lengths.values())
        target = plan.carrier(target_of(plan.task))
        if lengths.get(target):
            assert lengths[target] >= 0.7 * SHIFT_M_PER_LEVEL[variation.suite] - 1e-6
        for rider, carrier in plan.carried.items():
            assert lengths.get(rider) == lengths.get(carrier)
