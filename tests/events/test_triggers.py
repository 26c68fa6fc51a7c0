from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.errors import EntityError, ManifestError
from pytest_libero_max.events import triggers
from pytest_libero_max.events.triggers import (
    TRIGGERS,
    Above,
    AfterGrasp,
    AtStart,
    BudgetFraction,
    Moment,
    Proximity,
    StepsAfter,
    Trigger,
    Untouched,
    distance_m,
    trigger_from_dict,
)
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.mujoco_line import of_the_reference

BUDGET = 200
ALL: list[tuple[Trigger, dict[str, Any]]] = [
    (Proximity("box_1", 0.2), {"type": "on_proximity", "value": "box_1", "distance_m": 0.2}),
    (AtStart(), {"type": "at_start"}),
    (StepsAfter(12, entry=0), {"type": "steps_after", "steps": 12, "entry": 0}),
    (Untouched(3, entity="box_1"), {"type": "untouched", "value": "box_1", "steps": 3, "entry": -1}),
    (AfterGrasp("box_1"), {"type": "after_grasp", "value": "box_1"}),
    (Above("plate_1", 0.1), {"type": "above", "value": "plate_1", "radius_m": 0.1}),
    (BudgetFraction(0.25), {"type": "budget_fraction", "value": 0.25}),
]


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def moment(world: TinyWorld, step: int, *fired: int) -> Moment:
    return Moment(step, BUDGET, world, fired)


def steer(world: TinyWorld, to: Any, grip: float = -1.0, steps: int = 25) -> Iterator[int]:
    """Drive the hand somewhere; tells the number of steps after each."""
    for step in range(1, steps + 1):
        way = (np.asarray(to) - world.end_effector()) / 0.05
        world.step([*way.clip(-1.0, 1.0), 0.0, 0.0, 0.0, grip])
        yield step


# Their form.


@pytest.mark.parametrize(("trigger", "spelled"), ALL, ids=lambda value: getattr(value, "type", ""))
def test_a_trigger_is_spelled_as_manifests_spell_it(trigger: Trigger, spelled: dict[str, Any]) -> None:
    assert trigger.to_dict() == spelled
    assert trigger_from_dict(json.loads(json.dumps(spelled))) == trigger


def test_every_trigger_is_tested_here() -> None:
    assert {spelled["type"] for _, spelled in ALL} == set(TRIGGERS)


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        ("at_start", "trigger must be a JSON object, not str"),
        ({"type": "on_proximty"}, "type='on_proximty' is not a trigger. Did you mean 'on_proximity'"),
        ({"type": "on_proximity", "distance_m": 0.2}, "trigger lacks value"),
        ({"type": "at_start", "value": 3}, "unknown field 'value'"),
        ({"type": "on_proximity", "value": "", "distance_m": 0.2}, "on_proximity.value=''"),
        ({"type": "on_proximity", "value": "box_1", "distance_m": 0}, "on_proximity.distance_m=0"),
        ({"type": "on_proximity", "value": "box_1", "distance_m": math.inf}, "on_proximity.distance_m=inf"),
        ({"type": "above", "value": "plate_1", "radius_m": True}, "above.radius_m=True"),
        ({"type": "steps_after", "steps": 0, "entry": 0}, "steps_after.steps=0"),
        ({"type": "steps_after", "steps": 2, "entry": -2}, "steps_after.entry=-2"),
        ({"type": "budget_fraction", "value": 1.0}, "budget_fraction.value=1.0, .* Use 'at_start'"),
        ({"type": "after_grasp", "value": 3}, "after_grasp.value=3"),
    ],
)
def test_a_trigger_that_is_spelled_wrong_says_why(raw: Any, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        trigger_from_dict(raw)


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (object, "is not a frozen dataclass that extends"),
        (AtStart, "type='at_start', but it is registered as 'high'"),
        (dataclass(frozen=True)(type("High", (Trigger,), {"type": "high"})), "High has no rule"),
    ],
)
def test_what_is_offered_as_a_trigger_is_one(found: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        triggers.TRIGGERS._accepted("high", found)


def test_what_has_a_default_may_be_left_out() -> None:
    assert trigger_from_dict({"type": "steps_after", "steps": 3}) == StepsAfter(3)
    assert trigger_from_dict({"type": "above", "value": "plate_1"}) == Above("plate_1")


# Their rules.


@given(st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
def test_the_distance_is_euclidean_and_symmetric(values: list[float]) -> None:
    one, other = np.array(values[:3]), np.array(values[3:])
    assert distance_m(one, other) == distance_m(other, one) == pytest.approx(np.linalg.norm(one - other))


def test_proximity_is_reached_by_the_first_step_within_the_distance(world: TinyWorld) -> None:
    world.reset(0)
    far = distance_m(world.end_effector(), world.position("box_1"))
    trigger = Proximity("box_1", far + 0.01)
    assert trigger.reached(world)
    assert not trigger.fires(moment(world, 0))
    trigger = Proximity("box_1", 0.1)
    for step in steer(world, world.position("box_1")):
        near = distance_m(world.end_effector(), world.position("box_1"))
        assert trigger.fires(moment(world, step)) == (near <= 0.1)
        exactly = Proximity("box_1", near)
        assert exactly.fires(moment(world, step))
        assert not Proximity("box_1", math.nextafter(near, 0.0)).fires(moment(world, step))
    assert trigger.fires(moment(world, step))
    with pytest.raises(EntityError, match="box_1"):
        Proximity("box_2").fires(moment(world, 1))


def test_the_start_is_before_the_first_step(world: TinyWorld) -> None:
    assert AtStart().fires(moment(world, 0))
    assert not AtStart().fires(moment(world, 1))


def test_steps_are_counted_from_an_earlier_entry(world: TinyWorld) -> None:
    assert [StepsAfter(5).fires(moment(world, step, 3, 10)) for step in (8, 14, 15)] == [False, False, True]
    first = StepsAfter(5, entry=0)
    assert [first.fires(moment(world, step, 3, 10)) for step in (7, 8, 10)] == [False, True, True]


def test_a_share_of_the_budget_is_spent_after_its_steps(world: TinyWorld) -> None:
    assert [BudgetFraction(0.25).fires(moment(world, step)) for step in (0, 49, 50)] == [False, False, True]
    assert not BudgetFraction(0.001).fires(moment(world, 0))


def test_above_is_beside_a_receptacle_by_no_more_than_its_radius(world: TinyWorld) -> None:
    world.reset(0)
    plate, trigger = world.position("plate_1"), Above("plate_1", 0.08)
    assert not trigger.fires(moment(world, 0))
    fired = []
    for step in steer(world, np.add(plate, (0.0, 0.0, 0.15))):
        x, y, _ = world.end_effector() - plate
        assert trigger.fires(moment(world, step)) == (math.hypot(x, y) <= 0.08)
        fired.append(trigger.fires(moment(world, step)))
    assert not fired[0]
    assert fired[-1]
    world.place("plate_1", np.add(world.end_effector(), (0.0, 0.0, 0.05)))
    assert not trigger.fires(moment(world, step))


def test_a_grasp_is_two_fingers_and_no_support(world: TinyWorld) -> None:
    world.reset(0)
    trigger, box = AfterGrasp("box_1"), world.position("box_1")
    seen = []
    for place, grip in (
        (np.add(box, (0.0, 0.0, 0.1)), -1.0),
        (box, -1.0),
        (box, 1.0),
        (np.add(box, (0.0, 0.0, 0.1)), 1.0),
        (np.add(box, (0.0, 0.0, 0.1)), -1.0),
    ):
        *_, step = steer(world, place, grip)
        lifted = "main_table" not in world.contacts("box_1")
        seen.append((world.fingers_on("box_1"), lifted, trigger.fires(moment(world, step))))
        if seen[-1][-1]:
            assert not trigger.fires(moment(world, 0))
    assert seen == [
        (0, False, False),
        (0, False, False),
        (2, False, False),
        (2, True, True),
        (0, False, False),
    ]


@of_the_reference
def test_one_finger_is_no_grasp(world: TinyWorld) -> None:
    world.reset(0)
    beside = np.add(world.position("box_1"), (0.0, -0.08, 0.0))
    for place in (np.add(beside, (0.0, 0.0, 0.1)), beside, np.add(beside, (0.0, 0.04, 0.0))):
        for _ in steer(world, place, 1.0):
            pass
    world.place("box_1", np.add(world.position("box_1"), (0.0, 0.0, 0.005)))
    assert world.contacts("box_1") == ("gripper0",)
    assert world.fingers_on("box_1") == 1
    assert not AfterGrasp("box_1").fires(moment(world, 5))


def test_an_entity_in_the_hand_is_waited_for(world: TinyWorld) -> None:
    world.reset(0)
    trigger, box = Untouched(4, entity="box_1"), world.position("box_1")
    assert [trigger.fires(moment(world, step, 2)) for step in (5, 6, 7)] == [False, True, True]
    for place, grip in ((box, -1.0), (box, 1.0)):
        for _ in steer(world, place, grip):
            pass
    assert world.contacts("box_1") == ("gripper0", "main_table")
    assert not trigger.fires(moment(world, 99, 2))
    for _ in steer(world, np.add(box, (0.0, 0.0, 0.1)), -1.0):
        pass
    assert trigger.fires(moment(world, 99, 2))
