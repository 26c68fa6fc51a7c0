"""The five tasks as data: which events they can host, and that nobody else knows them."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

import pytest_libero_max
from pytest_libero_max.benchmark.suites import SUITES
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.conformance.policy.subject import first_scene
from pytest_libero_max.errors import ManifestError, SubstrateError
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.registry import BENCHMARK_EVENTS, eligible
from pytest_libero_max.lab.robosuite.robots import ROBOTS as ARMS
from pytest_libero_max.lab.robosuite.tasks import SPARES, TASKS, task_of
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.registry import SUBSTRATES
from pytest_libero_max.worlds.robot import ROBOTS

PACKAGE = Path(pytest_libero_max.__file__).parent
SEEN = {"illumination_switch", "camera_shift", "visual_theme_switch", "sensor_noise_onset"}
BROUGHT = {"distractor_burst", "obstacle_insertion"}


@pytest.mark.parametrize(
    ("task", "events"),
    [
        ("Lift", SEEN | BROUGHT | {"target_relocation"}),
        ("Stack", {*BENCHMARK_EVENTS}),
        ("PickPlaceCan", SEEN | BROUGHT | {"target_relocation"}),
        ("NutAssemblySquare", SEEN | BROUGHT | {"target_relocation"}),
        ("Door", SEEN),
    ],
)
def test_a_task_hosts_the_events_that_its_scene_allows(task: str, events: set[str]) -> None:
    metadata = next(known.metadata for known in TASKS if known.name == task)
    assert {event for event in BENCHMARK_EVENTS if eligible(event, metadata)} == events


def test_what_the_scene_keeps_out_of_it_needs_no_removal() -> None:
    case = make_case("distractor_burst", "robosuite_panda", 0)
    assert case.event.setup == ()
    assert {place["object"] for place in case.event.change["placements"]} == {*SPARES}


def test_an_event_that_a_task_cannot_host_is_refused_with_what_it_needs() -> None:
    with pytest.raises(ManifestError, match=r"receptacle_relocation.*Lift.*movable receptacle"):
        make_case("receptacle_relocation", "robosuite_panda", 0)


def test_there_is_no_sixth_task() -> None:
    for index in (-1, len(TASKS)):
        with pytest.raises(SubstrateError, match="task_index"):
            task_of(index)


def test_arms_and_suites_are_known_by_their_entry_points() -> None:
    kind = SUBSTRATES["robosuite"]
    assert kind.suites == tuple(ARMS)
    for suite, arm in ARMS.items():
        assert SUITES[suite].benchmark == "robosuite"
        assert ROBOTS[arm.name] == arm
        assert (arm.components, arm.control_hz) == (7, 20)


def test_its_track_has_three_cases_of_each_event_and_every_arm() -> None:
    cases = load_track("robosuite/smoke").cases
    assert Counter(case.event.name for case in cases) == dict.fromkeys(BENCHMARK_EVENTS, 3)
    assert {case.suite for case in cases} == {*ARMS}
    for case in cases:
        place = (case.suite, case.task_index, case.init_state_index)
        assert make_case(case.event.name, *place, variant=case.event.variant).record == case.record


def test_no_file_outside_their_folder_names_these_tasks() -> None:
    tasks = r"['\"](Lift|Stack|PickPlace\w*|NutAssembly\w*|Door)['\"]"
    words = re.compile(tasks + r"|robosuite_(panda|ur5e|sawyer)")
    naming = {
        str(file.relative_to(PACKAGE))
        for file in PACKAGE.rglob("*.py")
        if words.search(file.read_text(encoding="utf-8"))
    }
    assert {name.rpartition("/")[0] for name in naming} <= {"lab/robosuite"}


def test_policies_are_examined_on_the_track_of_their_substrate() -> None:
    shown = first_scene(load_policy("robosuite-expert"), "robosuite")
    assert shown.episode.suite in ARMS
    assert shown.episode.robot is ARMS[shown.episode.suite]
    shown.episode.world.close()  # type: ignore[union-attr]
