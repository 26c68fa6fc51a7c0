"""Rules for causes: each a sentence with the evidence that its name states, or None where it does not fit.

They ask from the last stage that an arm reached to the first: held, let go, grasped, closed, reached, on its
way. Each compares with what Base did at the same stage, where Base succeeded, and a distance has to be small
in itself as well. What time was left counts only beside what Base took.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from pytest_libero_max.errors import counted
from pytest_libero_max.report.arm_stages import (
    FailedArm,
    aim_in_words,
    cm,
    fact_in_words,
    is_at,
    name_in_words,
)

_CANCELS = "cancel_instruction"
"""Operation of the change that cancels a task; its module imports NumPy."""

_STARTED_M = 0.05
_REACTION_STEPS = 3  # a hand that is told to stop comes to rest in as many
_UNNOTICED_STEPS = 10  # pushes this soon after an event are of actions that were queued before
_STILL_STEPS = 20
_WAITS_M = 0.04  # beyond 2 cm farther than in Base: a hand that waits above an object
_AROUND_M = 0.1
_SAME_PLACE_M = 0.035  # by which distances at which a hand closes differ in one place
_SAME_GOAL_M = 0.06  # likewise of an object and its destination
_CLEARLY = 0.8, 0.6  # a place was meant, not another one, if it is nearer by these factors
_BESIDE_M = 0.06  # how much farther from an object a hand may close beside it
_NEARED_M = 0.04  # a hand that came so much nearer after it had closed arrived with closed fingers
_EARLY_M = 0.08  # distance of a hand around an object, where no Base closed
_AROUND_MORE_M = 0.02
_WAY_STEPS = 60  # a hand that comes later may have opened in between
_FAR_FROM_GOAL_M = 0.15
_FALL_M = 0.03
_HIGH_M = 0.05
_LOWERED_M = 0.04  # an object that sank by this much before it was let go was put down
_BESIDE_START_M = 0.05
_EARLY = 0.7  # of the steps from lift to release in Base
_CONTAINER_M = 0.08  # an object is let go so high above the floor of a basket
_SUNK_M = 0.008  # and has been lowered by so much
_PUSHED_M = 0.05
_TOPPLED_DEG = 45.0
_PART_MOVED = 0.01  # m or rad
_SHUT = 0.6  # of the way in Base: a drawer or door that moved less is not open
_OPENED = 0.02  # m or rad: way in Base of a drawer or door that had to be opened
_GRASP_STEPS, _MOST_GRASP_STEPS = 20, 40
_FIRST_STEPS = 60  # an object that Base touches this soon comes before the drawer that it goes into


def _not_stopped(arm: FailedArm) -> str | None:
    """The task was cancelled, and the policy moved on or completed it."""
    last = arm.event
    if last is None or last.evidence.get("operation") != _CANCELS:
        return None
    if arm.played.response_step is None:
        return f"The task was cancelled at step {last.step}, and the policy was not asked again."
    end = " The cancelled goal holds at the end." if len(arm.done) == len(arm.rows) else ""
    return (
        f"The task was cancelled at step {last.step}. The policy was told at step "
        f"{arm.played.response_step}, and did not stand still from then on, or completed the task.{end}"
    )


def _not_attempted(arm: FailedArm) -> str | None:
    """The hand never went 5 cm from where it started."""
    reach = arm.stages["reach_m"]
    if reach >= _STARTED_M:
        return None
    return f"The hand never went farther than {cm(reach)} from where it started{arm.repeats}."


# What became of an object that was held.


def _missed_moved_goal(arm: FailedArm) -> str | None:
    """The event moved the destination; the object was let go, or held to the end, where that had been."""
    row, event = arm.row, arm.event
    if event is None or arm.mover is None:
        return None
    begin = f"{arm.goal.capitalize()} moved {cm(arm.moved[arm.mover])} at step {event.step}; {arm.thing} "
    if row.holding and _is_old_goal(row.away_old_m, row.away_m):
        return (
            f"{begin}was still held at the end, {cm(row.away_m)} from it and {cm(row.away_old_m)} from "
            f"where it had been before{arm.held_up}."
        )
    if row.lost_open and _is_old_goal(row.lost_old_m, row.lost_m):
        return (
            f"{begin}was let go at step {row.lost_step}, {cm(row.lost_m)} from it and {cm(row.lost_old_m)} "
            "from where it had been before."
        )
    return None


def _is_old_goal(old_m: float | None, new_m: float | None) -> bool:
    return old_m is not None and new_m is not None and old_m <= min(_SAME_GOAL_M, _CLEARLY[1] * new_m)


def _blocked_by_obstacle(arm: FailedArm) -> str | None:
    """The hand was told to move and did not, for 2 s or more and half of the time from then on.

    It touched what has no part in the task.
    """
    number, first = int(arm.stages["blocked_steps"]), arm.stages["blocked_step"]
    names = [
        name
        for name in arm.stages["blocked_by"]
        if name != arm.row.entity and not is_at(arm.row.place or "", name) and not _is_surface(name)
    ]
    if not names or not arm.was_blocked:
        return None
    inserted = [name for name in names if name in arm.inserted]
    what = " and ".join(name_in_words(name, "") for name in inserted or names)
    put = f" that {'was' if len(inserted) == 1 else 'were'} put there" if inserted else ""
    return arm.after_event(
        f"the hand pushed against the {what}{put} from step {first} on, for {counted(number, 'step')}, "
        "without moving."
    )


def _is_surface(name: str) -> bool:
    return name.endswith(("table", "floor"))


def _timed_out_holding(arm: FailedArm) -> str | None:
    """The time was up with the object in the hand."""
    row = arm.row
    if not row.holding:
        return None
    away = "" if row.away_m is None else f", {cm(row.away_m)} from {arm.goal}"
    still = f"; it stayed there from step {arm.stages['still_step']} on" if arm.stopped else ""
    return arm.after_event(
        f"the hand still held {arm.thing}, lifted at step {row.lift_step}, when the time was up at step "
        f"{arm.steps}{away}{still}{arm.held_up}."
    )


def _moved_goal(arm: FailedArm) -> str | None:
    """The robot grasped the object, and moved the destination 5 cm or more, or knocked it over."""
    row, place = arm.row, arm.row.place or ""
    if row.grasp_step is None:
        return None
    usual = {} if arm.base is None else {name: way for name, _, way in _pushes(arm.base.probes["stages"])}
    for name, step, way in _pushes(arm.stages):
        toppled = name in arm.stages["toppled"]
        far = toppled or way >= _PUSHED_M + usual.get(name, 0.0)
        lost = row.lost_step if row.satisfied_step is None else None
        dropped_before = lost is not None and step > lost + _STILL_STEPS
        if is_at(place, name) and far and not dropped_before:
            over = " and knocked over" if toppled else ""
            return arm.after_event(f"{arm.goal} was pushed {cm(way)}{over}, from step {step} on.")
    if not row.lost_open or row.lost_m is None or row.away_m is None or row.strayed_m is None:
        return None
    if row.lost_m > _PUSHED_M or row.strayed_m > 0.02 or row.away_m - row.lost_m < _PUSHED_M:
        return None
    return arm.after_event(
        f"{arm.thing} was let go at step {row.lost_step}, {cm(row.lost_m)} from its place at {arm.goal}, "
        f"which moved afterwards and ended {cm(row.away_m)} from it."
    )


def _pushes(stages: Mapping[str, list[str | int | float]]) -> Iterator[tuple[str, int, float]]:
    """Other objects that moved: name, step, and distance in m."""
    yield from zip(*(stages[key] for key in ("moved", "moved_step", "moved_m")), strict=True)


def _undone(arm: FailedArm) -> str | None:
    """The fact of the goal held once, and not at the end."""
    row = arm.row
    if row.satisfied_step is None or row.satisfied:
        return None
    held = fact_in_words(row.goal, arm.record.instruction)
    return arm.after_event(f"{held} at step {row.satisfied_step}, and is not at the end.")


def _grasp_slipped(arm: FailedArm) -> str | None:
    """The object left the fingers though they were closed, or was not lifted by them."""
    row = arm.row
    if arm.lifted and row.lost_open is False:
        away = "" if row.lost_m is None else f", {cm(row.lost_m)} from {arm.goal}"
        return arm.after_event(
            f"{arm.thing} slipped out of closed fingers at step {row.lost_step}{away}, after a lift of "
            f"{cm(row.lift_m)}."
        )
    if not arm.lifted and arm.grasped:
        return arm.after_event(
            f"both fingers were on {arm.thing} at step {row.grasp_step}, and did not lift it."
        )
    return None


def _dropped(arm: FailedArm) -> str | None:
    """The fingers opened on the way: 3 cm or more above where the object ended, or where it was lifted."""
    row = arm.row
    if not arm.lifted or not row.lost_open or row.lost_step is None:
        return None
    fell, far = row.fell_m or 0.0, row.lost_m or 0.0
    lowered = row.lift_m - fell
    if row.carried_m < _BESIDE_START_M and far >= _FAR_FROM_GOAL_M and lowered < _LOWERED_M:
        return _let_go(arm)
    high = fell >= _HIGH_M or (fell >= _FALL_M and lowered < _LOWERED_M)
    if not high or (row.away_m or 0.0) < _HIGH_M or _is_release(arm, fell, lowered):
        return None
    return _let_go(arm)


def _is_release(arm: FailedArm, fell_m: float, lowered_m: float) -> bool:
    """Return True if an object was let go as Base lets it fall into a container, which may be elsewhere."""
    usual = arm.base_took("lift_step", "lost_step")
    if usual is None or not arm.row.goal.startswith("in "):
        return False
    late = (arm.row.lost_step or 0) - (arm.row.lift_step or 0) >= _EARLY * usual
    return late and fell_m >= _CONTAINER_M and lowered_m >= _SUNK_M


def _let_go(arm: FailedArm) -> str:
    row = arm.row
    fell = row.fell_m or 0.0
    down = f", {cm(fell)} above where it ended" if fell >= _FALL_M else ""
    back = f", {cm(row.carried_m)} from where it was lifted" if row.carried_m < _BESIDE_START_M else ""
    return arm.after_event(
        f"{arm.thing} was let go at step {row.lost_step}, {cm(row.lost_m)} from {arm.goal}{down}{back}; it "
        f"ended {cm(row.away_m)} from it."
    )


def _placed_elsewhere(arm: FailedArm) -> str | None:
    """The fingers put the object down 15 cm or more from the destination."""
    far = arm.row.lost_m is not None and arm.row.lost_m >= _FAR_FROM_GOAL_M
    return _let_go(arm) if arm.lifted and far else None


def _placed_beside_goal(arm: FailedArm) -> str | None:
    """The fingers opened near the destination, and the fact of the goal does not hold."""
    return _let_go(arm) if arm.lifted and arm.row.lost_m is not None else None


# Drawers, doors and knobs.


def _part_moved_too_little(arm: FailedArm) -> str | None:
    """The drawer, door or knob moved, but not far enough."""
    row = arm.row
    if row.travel is None or row.travel < _PART_MOVED:
        return None
    if not row.is_part:
        return _shut(arm)
    return arm.after_event(f"{arm.thing} moved by {_way(arm)}, which is not enough {aim_in_words(row.goal)}.")


def _part_not_moved(arm: FailedArm) -> str | None:
    """The hand reached the drawer, door or knob, or did the rest of the task, and it hardly moved."""
    row = arm.row
    if row.travel is None or row.travel >= _PART_MOVED:
        return None
    if not row.is_part:
        return _shut(arm)
    if not (arm.reached or row.touch_step is not None):
        return None
    return arm.after_event(
        f"the hand came within {cm(row.closest_m)} of {arm.thing} at step {row.closest_step}, but "
        "it did not move."
    )


def _shut(arm: FailedArm) -> str | None:
    """Return a sentence about an object whose drawer or door Base opened, and this arm did not."""
    row, usual = arm.row, arm.base_row
    if usual is None or row.travel is None or usual.travel is None or usual.travel < _OPENED:
        return None
    object_is_first = usual.touch_step is None or usual.touch_step - arm.answered <= _FIRST_STEPS
    if row.travel >= _SHUT * usual.travel or (object_is_first and not arm.lifted):
        return None
    kind = "door" if row.travel_rad is not None else "drawer"
    aside = f"{arm.thing} was put aside at step {row.lost_step}; " if row.lost_step is not None else ""
    return arm.after_event(
        f"{aside}the {kind} of {arm.goal} that it goes into moved by {_way(arm)} "
        f"({_in_words(usual.travel, row.travel_rad is not None)} in Base)."
    )


def _way(arm: FailedArm) -> str:
    return _in_words(arm.row.travel or 0.0, arm.row.travel_rad is not None)


def _in_words(way: float, hinged: bool) -> str:
    return f"{math.degrees(way):.0f} degrees" if hinged else cm(way)


# Grasps that were tried.


def _closed_early(arm: FailedArm) -> str | None:
    """The hand closed on its way, and came to the object with closed fingers."""
    row = arm.row
    if arm.lifted or not (arm.reached or arm.grasped) or row.close_step is None or row.close_m is None:
        return None
    way = (row.closest_step or 0) - row.close_step
    usual = arm.base_row.close_m if arm.base_row is not None else None
    far = max(_EARLY_M if usual is None else usual, row.closest_m or 0.0) + _NEARED_M
    if way <= 0 or row.close_m < far or not (way <= _WAY_STEPS or arm.grasped):
        return None
    return arm.after_event(
        f"the hand closed at step {row.close_step}, {cm(row.close_m)} from {arm.thing}{arm.in_base(usual)}, "
        f"and came within {cm(row.closest_m)} of it at step {row.closest_step} without closing again."
    )


def _missed_moved_target(arm: FailedArm) -> str | None:
    """The event moved the object; the hand closed where the object had been."""
    row, event = arm.row, arm.event
    if event is None or row.entity not in arm.moved or arm.lifted:
        return None
    if row.close_step is None or row.close_m is None or row.close_old_m is None:
        return None
    usual = arm.base_row.close_m if arm.base_row is not None else None
    off, off_new = abs(row.close_old_m - (usual or 0.0)), abs(row.close_m - (usual or 0.0))
    if off > min(_SAME_PLACE_M, _CLEARLY[0] * off_new):
        return None
    return (
        f"{arm.thing.capitalize()} moved {cm(arm.moved[row.entity])} at step {event.step}; the hand closed "
        f"at step {row.close_step}, {cm(row.close_m)} from it and {cm(row.close_old_m)} from where it had "
        f"been{arm.in_base(usual)}."
    )


def _wrong_object(arm: FailedArm) -> str | None:
    """The fingers lifted another object, as Base did not, and not the one of the task."""
    usual = () if arm.base is None else arm.base.probes["stages"]["wrong"]
    every = zip(arm.stages["wrong"], arm.stages["wrong_step"], strict=True)
    lifts = [(name, step) for name, step in every if name not in usual]
    if arm.lifted or not lifts:
        return None
    name, step = lifts[0]
    what = name_in_words(name, "")
    same = what == name_in_words(arm.row.entity, "")
    which = f"another {what} ({name})" if same else f"the {what}"
    return arm.after_event(f"the hand lifted {which} at step {step}, and never {arm.thing}.")


def _hit_obstacle(arm: FailedArm) -> str | None:
    """The robot pushed away what the event had put there, and never lifted the object of the task."""
    if arm.lifted or arm.event is None:
        return None
    closed = arm.row.close_step if _closed_near(arm) else None
    pushed = [
        (step, name, way)
        for name, step, way in _pushes(arm.stages)
        if name in arm.inserted
        and step > arm.event.step + _UNNOTICED_STEPS
        and (closed is None or (step < closed and (way >= _PUSHED_M or name in arm.stages["toppled"])))
    ]
    if not pushed:
        return None
    step, name, way = min(pushed)
    over = ", knocked over" if name in arm.stages["toppled"] else ""
    return arm.after_event(
        f"the {name_in_words(name, '')} that was put there was pushed {cm(way)}{over} from step {step} on, "
        f"and {arm.thing} was never lifted."
    )


def _toppled_target(arm: FailedArm) -> str | None:
    """The object leans by 45 degrees or more and was never lifted."""
    if arm.lifted or (arm.row.tilt_deg or 0.0) < _TOPPLED_DEG:
        return None
    return arm.after_event(f"{arm.thing} was knocked over: it leans by {arm.row.tilt_deg:.0f} degrees.")


def _pushed_target(arm: FailedArm) -> str | None:
    """The object was pushed 5 cm or more and never lifted."""
    if arm.lifted or (arm.row.shift_m or 0.0) < _PUSHED_M:
        return None
    return arm.after_event(f"{arm.thing} was pushed {cm(arm.row.shift_m)} and never lifted.")


def _closed_near(arm: FailedArm) -> bool:
    """Return True if the hand closed at most 6 cm farther from the object than one that has reached it."""
    row = arm.row
    if row.close_m is None or row.closest_m is None or arm.farther_m is None:
        return False
    beside = _BESIDE_M if arm.base_row is not None else 0.0
    return row.close_m - row.closest_m + arm.farther_m <= beside


def _closed_around(arm: FailedArm) -> bool:
    """Return True if the hand closed as near to the object as in Base, to 2 cm."""
    usual = _EARLY_M if arm.base_row is None or arm.base_row.close_m is None else arm.base_row.close_m
    return arm.row.close_m is not None and arm.row.close_m <= usual + _AROUND_MORE_M


def _grasp_missed(arm: FailedArm) -> str | None:
    """The hand closed near the object without getting hold of it."""
    row = arm.row
    if arm.lifted or not _closed_near(arm):
        return None
    return arm.after_event(
        f"the hand closed at step {row.close_step}, {cm(row.close_m)} from {arm.thing}"
        f"{arm.in_base(arm.base_row.close_m if arm.base_row else None)}, and did not get hold of it."
    )


# Ways to the object.


def _timed_out(arm: FailedArm) -> str | None:
    """The time was up on the way, or too few steps were left for what Base did next."""
    row = arm.row
    if arm.lifted:
        return None
    if arm.grasped and row.grasp_step is not None:
        what = f"both fingers were on {arm.thing} at step {row.grasp_step}"
        return _no_time(arm, what, row.grasp_step, arm.base_took("grasp_step", "lift_step"))
    if row.close_step is not None and _closed_near(arm):
        if not _closed_around(arm):
            return None
        usual = arm.in_base(arm.base_row.close_m if arm.base_row else None)
        what = f"the hand closed at step {row.close_step}, {cm(row.close_m)} from {arm.thing}{usual}"
        return _no_time(arm, what, row.close_step, arm.base_took("close_step", "lift_step"))
    closed = row.close_step is not None and row.close_step < arm.steps - _GRASP_STEPS
    stopped = arm.stopped and not _creeps(arm)
    if stopped or closed or row.touch_step is not None or arm.held_up:
        return None
    nearing = arm.base is not None and (row.closest_step or 0) >= arm.steps - _UNNOTICED_STEPS
    short = _was_short(arm)
    if not (nearing or short):
        return None
    done = f", with {len(arm.done)} of {len(arm.rows)} facts of the goal done" if len(arm.rows) > 1 else ""
    return arm.after_event(
        f"the time was up at step {arm.steps}{done}, when the hand had come within {cm(row.closest_m)} of "
        f"{arm.thing}{short}."
    )


def _no_time(arm: FailedArm, what: str, step: int, usual: int | None) -> str | None:
    """Return a sentence if a grasp came too late for the lift that follows in Base."""
    left = arm.steps - step
    if left >= min(_GRASP_STEPS if usual is None else max(usual, 1) + 5, _MOST_GRASP_STEPS):
        return None
    return arm.after_event(f"{what}, {counted(left, 'step')} before the time was up at step {arm.steps}.")


def _was_short(arm: FailedArm) -> str:
    """Return a clause if fewer steps were left after what was done than Base took then; else nothing."""
    if not arm.done or arm.base is None:
        return ""
    last = max(row.satisfied_step or 0 for row in arm.done)
    usual = [arm.base_rows[row.goal].satisfied_step or 0 for row in arm.done if row.goal in arm.base_rows]
    took = arm.base.steps - max(usual, default=0)
    if arm.steps - last >= took:
        return ""
    return f": {counted(arm.steps - last, 'step')} after the rest was done, for which Base took {took}"


def _stuck(arm: FailedArm) -> str | None:
    """The hand was told to move for 2 s or more and did not, around the object and before a lift."""
    row = arm.row
    if (
        arm.lifted
        or _closed_near(arm)
        or not arm.was_blocked
        or arm.farther_m is None
        or arm.farther_m > _AROUND_M
    ):
        return None
    return arm.after_event(
        f"the hand came within {cm(row.closest_m)} of {arm.thing}{arm.held_up}, from step "
        f"{arm.stages['blocked_step']} on."
    )


def _never_closed(arm: FailedArm) -> str | None:
    """The hand reached the object, or waited above it, and did not close."""
    row = arm.row
    if arm.lifted or arm.grasped or row.is_part or arm.farther_m is None or arm.farther_m > _WAITS_M:
        return None
    closed_there = row.close_step is not None and row.close_step <= (row.closest_step or 0)
    if closed_there or _closed_near(arm) or not (arm.reached or _waits(arm)):
        return None
    stays = f", stayed there from step {arm.stages['still_step']} on," if arm.stopped else ""
    usual = None if arm.base_row is None or arm.reached else arm.base_row.closest_m
    return arm.after_event(
        f"the hand came within {cm(row.closest_m)} of {arm.thing}{arm.in_base(usual)} at step "
        f"{row.closest_step}{stays} and did not close."
    )


def _waits(arm: FailedArm) -> bool:
    """Return True if the hand went on after the event, and stayed for 1 s or more where it came nearest."""
    there = (arm.row.closest_step or 0) >= int(arm.stages["still_step"]) - _REACTION_STEPS
    return there and arm.still >= _STILL_STEPS and not (_stopped_at_the_event(arm) or _creeps(arm))


def _creeps(arm: FailedArm) -> bool:
    """Return True if the hand was a little short of the object, and nearest at the end: slow, not waiting."""
    last = (arm.row.closest_step or 0) >= arm.steps - _REACTION_STEPS
    return last and not arm.reached and arm.farther_m is not None and arm.farther_m <= _WAITS_M


def _stopped_at_the_event(arm: FailedArm) -> bool:
    return arm.event is not None and int(arm.stages["still_step"]) <= arm.answered + _REACTION_STEPS


def _froze_after_event(arm: FailedArm) -> str | None:
    """The hand stopped at the first answer to the event, for good and short of the object. Base moved on."""
    if arm.event is None or arm.base is None or arm.still < _STILL_STEPS or arm.reached:
        return None
    stopped = int(arm.stages["still_step"])
    if not _stopped_at_the_event(arm) or arm.base.steps <= stopped:
        return None
    return arm.after_event(
        f"the hand stopped at step {stopped}, at least {cm(arm.row.closest_m)} from {arm.thing}"
        f"{arm.in_base(arm.base_row.closest_m if arm.base_row else None)}, and "
        f"stayed there until step {arm.steps}{arm.repeats}."
    )


def _froze(arm: FailedArm) -> str | None:
    """The hand stopped for good before it lifted the object, with a quarter of the time left."""
    row = arm.row
    if arm.lifted or arm.held_up or not arm.stopped or (arm.reached and not arm.grasped):
        return None
    stopped = int(arm.stages["still_step"])
    if arm.grasped and row.grasp_step is not None:
        if stopped > row.grasp_step + _UNNOTICED_STEPS:
            return None
        where = f"with both fingers on {arm.thing}"
    elif _closed_near(arm):
        return None
    else:
        where = f"and had come within {cm(row.closest_m)} of {arm.thing}"
    return arm.after_event(
        f"the hand stopped at step {stopped}, {where}, and stayed there until step {arm.steps}{arm.repeats}."
    )


def _never_reached(arm: FailedArm) -> str | None:
    """The hand did not come near the object."""
    row = arm.row
    if arm.lifted or arm.reached or row.closest_m is None:
        return None
    usual = None if arm.base_row is None else arm.base_row.closest_m
    return arm.after_event(
        f"the hand came no closer to {arm.thing} than {cm(row.closest_m)}{arm.in_base(usual)}, at step "
        f"{row.closest_step}{arm.held_up}."
    )


def _unclear(arm: FailedArm) -> str:
    """No rule fits what was recorded; the sentence tells it."""
    row = arm.row
    facts = [
        f"the hand came within {cm(row.closest_m)} of {arm.thing} at step {row.closest_step}",
        f"closed at step {row.close_step}, {cm(row.close_m)} from it" if row.close_step is not None else "",
        f"had both fingers on it at step {row.grasp_step}" if row.grasp_step is not None else "",
        f"lifted it at step {row.lift_step}" if row.lift_step is not None else "",
        f"lost it at step {row.lost_step}" if row.lost_step is not None else "",
    ]
    return arm.after_event(f"{', '.join(filter(None, facts))}{arm.held_up}.")


RULES: tuple[tuple[str, Callable[[FailedArm], str | None]], ...] = tuple(
    (rule.__name__.removeprefix("_"), rule)
    for rule in (
        _not_stopped,
        _not_attempted,
        _missed_moved_target,
        _missed_moved_goal,
        _blocked_by_obstacle,
        _timed_out_holding,
        _wrong_object,
        _hit_obstacle,
        _moved_goal,
        _undone,
        _closed_early,
        _froze_after_event,
        _timed_out,
        _toppled_target,
        _pushed_target,
        _stuck,
        _never_closed,
        _froze,
        _grasp_slipped,
        _dropped,
        _part_moved_too_little,
        _part_not_moved,
        _placed_elsewhere,
        _placed_beside_goal,
        _grasp_missed,
        _never_reached,
        _unclear,
    )
)
"""The rules in their order; the last one always fits."""
