"""Directions, eligibility and parameters of the event kinds, against published values."""

import math
from itertools import pairwise

import pytest

from pytest_libero_max.benchmark.cases import Event
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import EVENTS, eligible, eligible_events, resolve_event
from pytest_libero_max.events.relocation import DIRECTIONS
from pytest_libero_max.tasks.contents import task_metadata


def test_the_eight_directions_are_unit_vectors() -> None:
    assert len({*DIRECTIONS}) == 8
    assert all(math.isclose(math.hypot(*direction), 1.0) for direction in DIRECTIONS)


# Which of the ten tasks of a suite can host an event.
ELIGIBLE = {
    ("libero_spatial", "target_relocation"): {0, 1, 2, 6, 8},
    ("libero_spatial", "receptacle_relocation"): set(range(10)),
    ("libero_spatial", "distractor_burst"): set(),
    ("libero_spatial", "obstacle_insertion"): {0, 1, 2, 4, 6, 8},
    ("libero_object", "target_relocation"): set(range(10)),
    ("libero_object", "receptacle_relocation"): set(range(10)),
    ("libero_object", "distractor_burst"): set(range(10)),
    ("libero_object", "obstacle_insertion"): set(range(10)),
}


@pytest.mark.parametrize(("suite", "event"), ELIGIBLE)
def test_eligible_tasks(suite: str, event: str) -> None:
    assert {i for i in range(10) if eligible(event, task_metadata(suite, i))} == ELIGIBLE[suite, event]


def test_every_task_can_host_what_is_only_seen() -> None:
    seen = ("illumination_switch", "camera_shift", "visual_theme_switch", "sensor_noise_onset")
    for suite in ("libero_spatial", "libero_object"):
        for index in range(10):
            assert set(seen) <= set(eligible_events(task_metadata(suite, index)))


def resolve(event: str, variant: int, suite: str = "libero_object", task: int = 0) -> Event:
    return resolve_event(event, variant, task_metadata(suite, task), Identity("libero", suite, task, 0))


@pytest.mark.parametrize("variant", [0, 1])
@pytest.mark.parametrize("name", [name for name, kind in EVENTS.items() if kind.drawn])
def test_an_event_carries_its_severity_and_trigger(name: str, variant: int) -> None:
    event = resolve(name, variant)
    assert event.severity == EVENTS[name].severities[variant]
    assert (event.entity, event.trigger["distance_m"]) == ("alphabet_soup_1", 0.18)


def test_the_second_variant_goes_twice_as_far_the_same_way() -> None:
    near, far = (resolve("target_relocation", variant).change for variant in (0, 1))
    assert near["direction_xy"] == far["direction_xy"]
    assert [2 * value for value in near["delta_position_m"]] == pytest.approx(
        far["delta_position_m"], abs=1e-8
    )


@pytest.mark.parametrize("variant", [0, 1])
def test_a_burst_surrounds_the_target_with_five_objects(variant: int) -> None:
    event = resolve("distractor_burst", variant)
    placements = event.change["placements"]
    assert len({placement["object"] for placement in placements}) == 5
    assert [removal["object"] for removal in event.setup] == [p["object"] for p in placements]
    angles = []
    for placement in placements:
        x, y, z = placement["offset_m"]
        assert 0.09 <= math.hypot(x, y) <= 0.17
        assert z == 0.0
        angles.append(math.atan2(y, x))
    turns = [(after - before) % (2 * math.pi) for before, after in pairwise(angles)]
    assert turns == pytest.approx([2 * math.pi / 5] * 4, abs=1e-6)
    assert "alphabet_soup_1" not in {p["object"] for p in placements}


def test_removed_objects_are_kept_apart() -> None:
    kept = [removal["offworld_position_m"] for removal in resolve("distractor_burst", 0).setup]
    assert [position[0] for position in kept] == pytest.approx([-2.0, -2.2, -2.4, -2.6, -2.8])


def test_the_two_obstacles_differ_in_object_and_place() -> None:
    first, second = (resolve("obstacle_insertion", variant).change for variant in (0, 1))
    assert (first["object"], second["object"]) == ("butter_1", "cream_cheese_1")
    assert (first["offset_m"], second["offset_m"]) == ([0.14, 0.0, 0.0], [0.0, -0.14, 0.0])


def test_an_event_a_task_cannot_host_is_refused() -> None:
    with pytest.raises(ManifestError, match=r"distractor_burst' .*: illumination_switch,"):
        resolve("distractor_burst", 0, "libero_spatial")


def test_an_event_that_only_manifests_spell_out_is_not_drawn() -> None:
    with pytest.raises(ManifestError, match=r"task_cancel' .*a manifest"):
        resolve("task_cancel", 0)
    names = {name for name, kind in EVENTS.items() if not kind.drawn}
    assert names == {"instruction_receptacle_update", "instruction_target_update", "task_cancel"}


def test_an_unknown_event_or_variant_is_refused() -> None:
    with pytest.raises(ManifestError, match=r"event='camera_shit' .*'camera_shift'"):
        resolve("camera_shit", 0)
    with pytest.raises(ManifestError, match="variant=2,"):
        resolve("camera_shift", 2)
