"""Cases that are not sensible, each with the reason it must be given."""

import subprocess
import sys

import numpy as np
import pytest

from pytest_libero_max.benchmark.cases import Case, parse_case
from pytest_libero_max.benchmark.identity import Identity
from pytest_libero_max.benchmark.records import case_record
from pytest_libero_max.changes import Change, InsertObstacle, MoveObject, RemoveObject, ShiftCamera
from pytest_libero_max.changes.change import Evidence
from pytest_libero_max.events.configurations import Cell, Configuration
from pytest_libero_max.events.kind import Scenario
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.triggers import Proximity
from pytest_libero_max.makers.construction.preflight import preflight
from pytest_libero_max.substrates.embedded.catalogue.pro_catalogue import pro_suite
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.substrates.tiny.world import TinyWorld

WORLD = TinyWorld()


def case_of(
    event: str, change: Change, *setup: Change, trigger: str = "box_1", distance_m: float = 0.18
) -> Case:
    identity = Identity("libero", "libero_spatial", 0, 0)
    scenario = Scenario(change.to_dict(), tuple(removal.to_dict() for removal in setup))
    drawn = EVENTS[event].event(0, identity.seed(event, 0), scenario, Proximity(trigger, distance_m))
    return parse_case(case_record(identity, drawn, "tiny"))


def found(case: Case) -> str:
    return "; ".join(map(str, preflight(WORLD, case).problems))


def move(x: float, y: float) -> Case:
    return case_of("target_relocation", MoveObject("box_1", (x, y, 0.0)))


def insertion(x: float, y: float) -> Case:
    return case_of(
        "obstacle_insertion",
        InsertObstacle("clutter_1", "box_1", (x, y, 0.0), True),
        RemoveObject("clutter_1", (-2.0, 0.0, -5.0)),
    )


@pytest.mark.parametrize(
    "case",
    [
        case_of("camera_shift", ShiftCamera("agentview", (0.06, 0.0, 0.02), 18.0, 12.0)),
        move(0.06, 0.0),
        insertion(0.14, 0.0),
    ],
    ids=["camera", "move", "insertion"],
)
def test_a_sensible_case_passes(case: Case) -> None:
    assert found(case) == ""


def test_an_overlap_is_found() -> None:
    assert "clutter_1 is -" in found(insertion(0.03, 0.0))
    assert "mm from box_1" in found(insertion(0.03, 0.0))


def test_a_near_miss_is_found() -> None:
    gap = np.nextafter(0.03 + 0.02, 1.0)  # the half widths of the two boxes
    assert "mm from box_1" in found(insertion(gap + 0.005, 0.0))
    assert "mm from box_1" not in found(insertion(gap + 0.012, 0.0))


def test_an_object_that_falls_off_the_table_is_found() -> None:
    reasons = found(move(0.6, 0.0))
    assert "of it down" in reasons
    assert "its support main_table" in reasons


def test_an_event_that_solves_the_task_is_found() -> None:
    WORLD.reset(0)
    plate, box = WORLD.position("plate_1"), WORLD.position("box_1")
    way = plate - box + [0.0, 0.0, 0.04]
    change = MoveObject("box_1", tuple(way))
    assert "event solves the" in found(case_of("target_relocation", change))


def test_an_entity_out_of_reach_is_found() -> None:
    shift = ShiftCamera("agentview", (0.0, 0.0, 0.0), 1.0, 0.0)
    case = case_of("camera_shift", shift, trigger="cabinet_1", distance_m=0.001)
    (problem,) = preflight(WORLD, case).problems
    assert problem.check == "trigger"
    assert "0.001 m of cabinet_1" in problem.detail


def test_what_also_happens_without_the_event_is_not_its_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    sliding = TinyWorld()
    original = sliding.reset

    def reset(init: int) -> None:
        original(init)
        sliding.place("clutter_5", sliding.position("clutter_5") + np.array([0.0, 0.0, 0.1]))

    monkeypatch.setattr(sliding, "reset", reset)
    assert preflight(sliding, move(0.06, 0.0)).problems == ()


def test_what_comes_back_is_compared_with_the_same_moments_of_the_episode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Objects that begin inside the floor jump when they come back, as they do when the episode begins."""
    jumping = TinyWorld()
    original = jumping.reset

    def reset(init: int) -> None:
        original(init)
        jumping.push("clutter_1", (0.0, 0.0, 1.0))

    def insert(self: InsertObstacle, world: TinyWorld) -> Evidence:
        evidence = apply(self, world)
        world.push("clutter_1", (0.0, 0.0, 1.0))
        return evidence

    apply = InsertObstacle.apply
    monkeypatch.setattr(InsertObstacle, "apply", insert)
    assert "clutter_1 moves by" in str(preflight(jumping, insertion(0.14, 0.0)).problems)
    monkeypatch.setattr(jumping, "reset", reset)
    assert preflight(jumping, insertion(0.14, 0.0)).problems == ()


@pytest.mark.parametrize("at_start_too", [True, False])
def test_what_comes_back_may_leave_its_support_as_it_does_when_the_episode_begins(
    monkeypatch: pytest.MonkeyPatch, at_start_too: bool
) -> None:
    """An initial state with an object a little inside its support throws it up."""
    thrown = TinyWorld()
    original, apply = thrown.reset, InsertObstacle.apply

    def reset(init: int) -> None:
        original(init)
        thrown.place("clutter_1", thrown.position("clutter_1") - np.array([0.0, 0.0, 0.001]))
        if at_start_too:
            thrown.push("clutter_1", (0.0, 0.0, 1.0))

    def insert(self: InsertObstacle, world: TinyWorld) -> Evidence:
        evidence = apply(self, world)
        world.push("clutter_1", (0.0, 0.0, 1.0))
        return evidence

    monkeypatch.setattr(thrown, "reset", reset)
    monkeypatch.setattr(InsertObstacle, "apply", insert)
    lost = "clutter_1 has lost its support main_table" in str(
        preflight(thrown, insertion(0.14, 0.0)).problems
    )
    assert lost is not at_start_too


@pytest.mark.parametrize(("suite", "task"), [("libero_goal", 0), ("libero_10", 2)])
def test_a_task_that_the_expert_never_begins_is_not_rejected_for_it(suite: str, task: int) -> None:
    case = Configuration(pro_suite("task", suite)[task], 0).case(Cell("task", "illumination_switch", 0))
    substrate = open_substrate("embedded")
    assert preflight(substrate.world(case), case).passed
    substrate.close()


def test_no_policy_has_a_part_in_it() -> None:
    code = (
        "import sys, pytest_libero_max.makers.construction.preflight\n"
        "rooms = {'policies', 'experts', 'pairing', 'stats', 'report', 'plugin'}\n"
        "seen = {name.split('.')[1] for name in sys.modules if name.startswith('pytest_libero_max.')}\n"
        "assert not rooms & seen, rooms & seen\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
