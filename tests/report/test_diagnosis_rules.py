"""Rules for causes on made-up stages: the evidence that each name needs."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec import structs

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report.diagnosis import Diagnosis, diagnose
from pytest_libero_max.tasks.suites import LIBERO
from tests.report.made_up import plan, record_of

STEPS = 220
PLATE, DRAWER = "on bowl_1 plate_1", "in bowl_1 wooden_cabinet_1_top_region"

_FACT: Json = {
    "goal": PLATE,
    "entity": "bowl_1",
    "satisfied": False,
    "satisfied_step": None,
    "closest_m": 0.04,
    "closest_step": 35,
    "touch_step": None,
    "close_step": None,
    "close_m": None,
    "close_old_m": None,
    "grasp_step": None,
    "lift_step": None,
    "lift_m": 0.0,
    "carried_m": 0.0,
    "above_step": None,
    "lost_step": None,
    "lost_open": None,
    "lost_m": None,
    "lost_old_m": None,
    "fell_m": None,
    "holding": False,
    "away_m": 0.3,
    "away_old_m": None,
    "strayed_m": None,
    "shift_m": 0.0,
    "tilt_deg": 0.0,
    "travel_m": None,
    "travel_rad": None,
}
_HAND: Json = {
    "reach_m": 0.4,
    "still_step": STEPS - 2,
    "repeated_queries": 0,
    "blocked_step": None,
    "blocked_steps": 0,
    "blocked_by": [],
    "moved": [],
    "moved_step": [],
    "moved_m": [],
    "toppled": [],
    "wrong": [],
    "wrong_step": [],
}
CLOSED = {"close_step": 32, "close_m": 0.042, "touch_step": 36, "grasp_step": 36}
LIFTED = {**CLOSED, "lift_step": 42, "lift_m": 0.2, "carried_m": 0.3}
HELD = {**LIFTED, "holding": True}
LET_GO = {**LIFTED, "lost_step": 85, "lost_open": True, "lost_m": 0.2, "fell_m": 0.0, "away_m": 0.2}
IN_BASE = {
    **LIFTED,
    "satisfied": True,
    "satisfied_step": 90,
    "lost_step": 88,
    "lost_open": True,
    "lost_m": 0.0,
}


def stages(*facts: Json, steps: int = STEPS, **columns: Any) -> Json:
    """Columns of the probe: one fact with some columns changed, or several facts."""
    rows = [_FACT | fact for fact in facts] or [
        _FACT | {name: value for name, value in columns.items() if name in _FACT}
    ]
    hand = _HAND | {"still_step": steps - 2}
    hand |= {name: value for name, value in columns.items() if name in _HAND}
    return {**{name: [row[name] for row in rows] for name in _FACT}, **hand}


def judged(
    dynamic: Json,
    base: Json | None = None,
    moved: Json | None = None,
    steps: int = STEPS,
    base_steps: int = 90,
) -> Diagnosis:
    """The diagnosis of a regression.

    Args:
        dynamic: Stages of Dynamic.
        base: Stages of Base; None: the usual ones.
        moved: Objects that the event moved by 12 cm, with their old position.
        steps: Steps of Dynamic, which are all that it had.
        base_steps: Steps of Base.
    """
    before = {name: [0.0, 0.0, 0.9] for name in moved or {}}
    after = {name: [0.12, 0.0, 0.9] for name in moved or {}}
    evidence = {"operation": "made_up", "before": {"position_m": before}, "after": {"position_m": after}}
    record = record_of(
        plan()[0],
        True,
        False,
        suite=next(suite.name for suite in LIBERO if suite.budget == steps),
        max_steps=steps,
        dynamic_steps=steps,
        base_steps=base_steps,
        evidence=evidence,
    )
    probes = {"base": stages(IN_BASE) if base is None else base, "dynamic": dynamic}
    arms = {name: structs.replace(arm, probes={"stages": probes[name]}) for name, arm in record.arms.items()}
    why = diagnose(structs.replace(record, arms=arms), "dynamic")
    assert why is not None
    return why


def test_what_is_put_aside_before_a_drawer_that_stays_shut_is_no_wrong_place() -> None:
    base = stages(IN_BASE | {"goal": DRAWER, "travel_m": 0.132}, steps=250)
    aside = LET_GO | {"goal": DRAWER, "lost_m": 0.004, "away_m": 0.004}
    why = judged(stages(aside | {"travel_m": 0.002}), base, base_steps=210)
    assert why.cause == "part_not_moved"
    assert "13.2 cm in Base" in why.sentence
    assert judged(stages(aside | {"travel_m": 0.05}), base).cause == "part_moved_too_little"
    assert judged(stages(aside | {"travel_m": 0.13}), base).cause == "placed_beside_goal"
    assert judged(stages(aside), base).cause == "placed_beside_goal"  # an older record: not known


@pytest.mark.parametrize("above_m", [0.02, 0.04])
def test_a_hand_that_waits_above_the_object_has_not_frozen(above_m: float) -> None:
    waits = stages(closest_m=0.04 + above_m, closest_step=40, still_step=38)
    assert judged(waits).cause == "never_closed"


def test_a_hand_that_stops_at_the_answer_short_of_the_object_has_frozen() -> None:
    assert judged(stages(closest_m=0.09, closest_step=27, still_step=26)).cause == "froze_after_event"
    assert judged(stages(closest_m=0.15, closest_step=40, still_step=80)).cause == "froze"
    assert judged(stages(CLOSED, still_step=40)).cause == "froze"


@pytest.mark.parametrize(
    ("columns", "cause"),
    [
        (HELD | {"away_m": 0.61, "away_old_m": 0.51}, "timed_out_holding"),
        (HELD | {"away_m": 0.15, "away_old_m": 0.04}, "missed_moved_goal"),
        (LET_GO | {"lost_m": 0.1766, "lost_old_m": 0.1214}, "placed_elsewhere"),
        (LET_GO | {"lost_m": 0.12, "lost_old_m": 0.04}, "missed_moved_goal"),
        (LET_GO | {"lost_m": 0.04, "lost_old_m": 0.03}, "placed_beside_goal"),
    ],
)
def test_a_destination_that_moved_is_missed_only_at_its_old_place(columns: Json, cause: str) -> None:
    assert judged(stages(columns), moved={"plate_1": None}).cause == cause


@pytest.mark.parametrize(
    ("close_m", "old_m", "cause"),
    [
        (0.1315, 0.1412, "never_reached"),
        (0.15, 0.042, "missed_moved_target"),
        (0.15, 0.09, "never_reached"),
        (0.08, 0.15, "grasp_missed"),
    ],
)
def test_an_object_that_moved_is_missed_only_at_its_old_place(
    close_m: float, old_m: float, cause: str
) -> None:
    closed = stages(close_step=40, close_m=close_m, close_old_m=old_m, closest_m=close_m - 0.001)
    why = judged(closed, moved={"bowl_1": None})
    assert why.cause == cause, why.sentence


@pytest.mark.parametrize("left", [2, 7])
def test_a_grasp_with_too_few_steps_left_ran_out_of_time(left: int) -> None:
    late = {"closest_step": STEPS - left, "close_step": STEPS - left - 4, "close_m": 0.042}
    assert judged(stages(late)).cause == "timed_out"
    assert (
        judged(stages(late | {"grasp_step": STEPS - left, "touch_step": STEPS - left})).cause == "timed_out"
    )
    early = CLOSED | {"closest_step": 40}
    assert judged(stages(early)).cause == "grasp_slipped"
    assert judged(stages(early | {"grasp_step": None, "touch_step": None})).cause == "grasp_missed"


def test_time_that_is_spent_elsewhere_after_the_first_object_was_not_too_short() -> None:
    facts = [
        {"goal": "in soup_1 basket_1", "entity": "soup_1"},
        {"goal": "in sauce_1 basket_1", "entity": "sauce_1"},
    ]
    base = stages(
        *(IN_BASE | fact | {"satisfied_step": step} for fact, step in zip(facts, (90, 180), strict=True))
    )
    done = IN_BASE | facts[0] | {"satisfied_step": 90}
    rises = {**facts[1], "closest_m": 0.175, "closest_step": 60}
    assert judged(stages(done, rises, steps=520), base, steps=520, base_steps=180).cause == "never_reached"
    late = done | {"satisfied_step": 480}
    why = judged(stages(late, rises, steps=520), base, steps=520, base_steps=180)
    assert why.cause == "timed_out"
    assert "40 steps" in why.sentence


def test_a_fist_is_no_hand_that_never_closed() -> None:
    fist = {"close_step": 26, "close_m": 0.14, "closest_m": 0.05, "closest_step": 38}
    assert judged(stages(fist)).cause == "closed_early"
    assert (
        judged(stages(fist | {"touch_step": 36, "grasp_step": 36, "closest_step": 200})).cause
        == "closed_early"
    )
    assert judged(stages(closest_m=0.05, closest_step=38)).cause == "never_closed"


def test_what_an_open_hand_shoves_up_was_not_lifted() -> None:
    shoved = LET_GO | {"close_step": None, "close_m": None, "grasp_step": 40, "shift_m": 0.2}
    assert judged(stages(shoved)).cause == "pushed_target"


@pytest.mark.parametrize(
    ("columns", "cause"),
    [
        ({"lost_step": 60, "fell_m": 0.19, "away_m": 0.25}, "dropped"),
        ({"lost_step": 45, "lift_m": 0.03, "fell_m": 0.025, "carried_m": 0.01}, "dropped"),
        ({"lost_step": 80, "fell_m": 0.0}, "placed_elsewhere"),
        ({"lost_step": 80, "fell_m": 0.0, "lost_m": 0.09, "away_m": 0.09}, "placed_beside_goal"),
        ({"lost_open": False}, "grasp_slipped"),
    ],
)
def test_how_an_object_left_the_hand(columns: Json, cause: str) -> None:
    assert judged(stages(LET_GO | columns)).cause == cause


def test_an_object_that_falls_as_into_a_basket_was_brought_to_another_place() -> None:
    basket = {"goal": "in bowl_1 basket_1_contain_region"}
    base = stages(IN_BASE | basket)
    falls = LET_GO | basket | {"lift_m": 0.165, "fell_m": 0.14}
    assert judged(stages(falls | {"lost_step": 86}), base).cause == "placed_elsewhere"
    assert judged(stages(falls | {"lost_step": 55}), base).cause == "dropped"


def test_a_block_is_the_cause_where_it_lasted_and_base_had_none() -> None:
    blocked: Json = {"blocked_step": 60, "blocked_steps": 120, "blocked_by": ["cookies_1"], "closest_m": 0.2}
    assert judged(stages(**blocked)).cause == "blocked_by_obstacle"
    assert judged(stages(**blocked), stages(IN_BASE, **blocked)).cause == "never_reached"
    assert judged(stages(**{**blocked, "blocked_steps": 45})).cause == "never_reached"


def test_a_hand_that_is_held_up_by_nothing_is_told_plainly() -> None:
    blocked: Json = {"blocked_step": 60, "blocked_steps": 45, "closest_m": 0.2}
    assert "45 steps, though it touched nothing" in judged(stages(**blocked)).sentence
    by = judged(stages(**blocked, blocked_by=["cookies_1"])).sentence
    assert "45 steps by the cookies" in by


def test_what_no_rule_knows_is_unclear_and_told() -> None:
    why = judged(stages(closest_step=200, close_step=30, close_m=0.3))
    assert why.cause == "unclear"
    assert "closed at step 30" in why.sentence
