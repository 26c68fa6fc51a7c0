"""Causes of failed arms: one for each, from a fixed vocabulary, by rules over the stages that were recorded.

A diagnosis is a pure function of a pair's record. It says what happened, in the first of :data:`CAUSES` that
fits; it does not say why the policy acted so.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any

from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, FiringRecord, PairRecord
from pytest_libero_max.report.happenings import happenings, happenings_text
from pytest_libero_max.report.report_document import ChangedPair

NOT_RECORDED = "not_recorded"

STAGES = "stages"
"""Name of the probe that the rules read."""

_CANCELS = "cancel_instruction"
"""Operation of the change that cancels a task; its module imports NumPy."""

_STARTED_M = 0.05
_BLOCKED_STEPS = 40
_STILL_STEPS = 20
_ARRIVED_M = 0.01  # by which distances at which a hand stops differ in one place
_REACTION_STEPS = 10
_NEAR_M = 0.12
_AROUND_M = 0.1
_REACHED_MORE_M = 0.02  # how much farther than in a Base that succeeded the hand may be
_MOVED_M = 0.02
_SAME_PLACE_M = 0.015  # by which distances at which a hand closes differ in one place
_BESIDE_M = 0.06  # how much farther from an object a hand may close beside it
_FAR_FROM_GOAL_M = 0.15
_FALL_M = 0.05
_PUSHED_M = 0.05
_TOPPLED_DEG = 45.0
_PART_MOVED = 0.01  # m or rad


@dataclass(frozen=True)
class Diagnosis:
    """The cause of a failed arm.

    Attributes:
        cause: A key of :data:`CAUSES`.
        sentence: The cause with its numbers.
    """

    cause: str
    sentence: str


def diagnose(record: PairRecord, arm: str) -> Diagnosis | None:
    """Return the diagnosis of an arm of a pair; None if it succeeded.

    Raises:
        ReportError: The case was not played in this arm.
    """
    played = record.arm(arm)
    if played.success:
        return None
    base = record.arms.get(BASE)
    if base is not None and arm != BASE and not base.success:
        found = _of_arm(record, base)
        return Diagnosis("already_failing_in_base", f"Base failed too ({found.cause}). {found.sentence}")
    return _of_arm(record, played)


def changed_pairs(records: Iterable[PairRecord]) -> list[ChangedPair]:
    """Return the pairs of which one arm succeeded and the other failed, in the order of their item ids."""
    found = []
    for record in sorted(records, key=lambda record: record.item_id):
        if record.base_success != record.dynamic_success:
            why = diagnose(record, DYNAMIC if record.base_success else BASE)
            assert why is not None
            found.append(
                ChangedPair(
                    item_id=record.item_id,
                    event=record.event,
                    outcome="regression" if record.base_success else "change_associated_success",
                    cause=why.cause,
                    sentence=why.sentence,
                )
            )
    return found


def _of_arm(record: PairRecord, arm: ArmRecord) -> Diagnosis:
    stages = arm.probes.get(STAGES, {})
    if not ({field.name for field in fields(_Row)} <= stages.keys() and stages["goal"]):
        return Diagnosis(NOT_RECORDED, "The record holds no stages.")
    base = record.arms.get(BASE)
    seen = _Seen.of(record, arm, base if base is not None and base.success else None)
    return next(Diagnosis(cause, sentence) for cause, rule in _RULES if (sentence := rule(seen)))


@dataclass(frozen=True)
class _Row:
    """One fact of the goal; the columns of the probe."""

    goal: str
    entity: str
    satisfied: bool
    satisfied_step: int | None
    closest_m: float | None
    closest_step: int | None
    touch_step: int | None
    close_step: int | None
    close_m: float | None
    close_old_m: float | None
    grasp_step: int | None
    lift_step: int | None
    lift_m: float
    above_step: int | None
    lost_step: int | None
    lost_open: bool | None
    lost_m: float | None
    lost_old_m: float | None
    fell_m: float | None
    holding: bool
    away_m: float | None
    away_old_m: float | None
    strayed_m: float | None
    shift_m: float | None
    tilt_deg: float | None
    travel_m: float | None
    travel_rad: float | None

    @property
    def travel(self) -> float | None:
        """Way of a drawer, door or knob, m or rad; None for an object."""
        return self.travel_m if self.travel_rad is None else self.travel_rad

    @property
    def place(self) -> str | None:
        """The destination, as the goal spells it."""
        words = self.goal.split(" ")
        return words[2] if len(words) == 3 else None


def _rows(stages: Mapping[str, Any]) -> tuple[_Row, ...]:
    names = [field.name for field in fields(_Row)]
    return tuple(_Row(*values) for values in zip(*(stages[name] for name in names), strict=True))


@dataclass(frozen=True)
class _Seen:
    """A failed arm as the rules see it.

    Attributes:
        record: Its pair.
        arm: Its record.
        stages: The columns about the hand and about other objects.
        row: The fact of the goal that the failure is about.
        other: The same fact in Base, where Base succeeded and is another arm.
        base: Base, likewise.
        done: Number of facts that hold at the end.
        facts: Number of facts of the goal.
        event: The first firing that did not only wait, or None.
        happened: Everything that happened, as the beginning of a sentence; empty where nothing did.
        moved: Objects that it moved, with where they were and came to be.
        inserted: Objects that it put into the scene.
    """

    record: PairRecord
    arm: ArmRecord
    stages: Mapping[str, Any]
    row: _Row
    other: _Row | None
    base: ArmRecord | None
    done: int
    facts: int
    event: FiringRecord | None
    happened: str
    moved: Mapping[str, float]
    inserted: frozenset[str]

    @classmethod
    def of(cls, record: PairRecord, arm: ArmRecord, base: ArmRecord | None) -> _Seen:
        happened = happenings(record, arm)
        event = happened[0].firing if happened else None
        moved, inserted = _moves(event)
        rows = _rows(arm.probes[STAGES])
        row = _in_question(rows, moved)
        other = None
        if base is not None and STAGES in base.probes:
            other = next((b for b in _rows(base.probes[STAGES]) if b.goal == row.goal), None)
        done = sum(row.satisfied for row in rows)
        stages = arm.probes[STAGES]
        said = happenings_text(happened)
        return cls(record, arm, stages, row, other, base, done, len(rows), event, said, moved, inserted)

    @property
    def steps(self) -> int:
        """Policy steps of the arm."""
        return self.arm.steps

    @property
    def thing(self) -> str:
        """The object or fixture in question, in words."""
        words = self.row.goal.split(" ")
        return f"the {_words(words[1] if words[1:] else self.row.entity, self.record.instruction)}"

    @property
    def goal(self) -> str:
        """The destination in question, in words."""
        return f"the {_words(self.row.place or '', self.record.instruction)}"

    @property
    def mover(self) -> str | None:
        """The object at or in which the destination is, where the event moved it."""
        place = self.row.place or ""
        return next((name for name in self.moved if place == name or place.startswith(f"{name}_")), None)

    @property
    def lifted(self) -> bool:
        """True if the object was lifted, or held, after the event."""
        row, event = self.row, self.event
        last = max((step for step in (row.lift_step, row.lost_step) if step is not None), default=-1)
        return last >= 0 and (row.holding or event is None or last > event.step or not self.moved)

    @property
    def near_m(self) -> float:
        """Distance from which the hand has reached the object."""
        known = self.other.closest_m if self.other is not None else None
        return _NEAR_M if known is None else known + _REACHED_MORE_M

    @property
    def reached(self) -> bool:
        """True if the hand came near the object."""
        return self.row.closest_m is not None and self.row.closest_m <= self.near_m

    @property
    def still(self) -> int:
        """Number of steps at the end during which the hand stayed where it ends."""
        return self.steps - int(self.stages["still_step"])

    @property
    def repeats(self) -> str:
        """A clause about answers that repeat, or nothing."""
        number = int(self.stages["repeated_queries"])
        return f"; the last {number} queries got the answer of the one before" if number >= 3 else ""

    @property
    def in_base(self) -> str:
        """The distance at which the hand closed in Base, in brackets, or nothing."""
        usual = None if self.other is None else self.other.close_m
        return "" if usual is None else f" ({_cm(usual)} in Base)"

    @property
    def held_up(self) -> str:
        """A clause about a hand that was held up, or nothing."""
        number = int(self.stages["blocked_steps"])
        by = (
            " and ".join(f"the {_words(name, '')}" for name in self.stages["blocked_by"])
            or "nothing that it touched"
        )
        return f"; it was held up for {number} steps by {by}" if number >= _BLOCKED_STEPS else ""

    def after_event(self, text: str) -> str:
        """Return a sentence that begins with what happened, where something did."""
        return f"{self.happened}; {text}" if self.happened else text[0].upper() + text[1:]


def _moves(event: FiringRecord | None) -> tuple[dict[str, float], frozenset[str]]:
    """Objects that an event moved, by how far in m, and those that it put into the scene."""
    if event is None:
        return {}, frozenset()
    before, after = event.evidence.get("before", {}), event.evidence.get("after", {})
    inserted = frozenset(before.get("taken_out", ())) - frozenset(after.get("taken_out", ()))
    was, now = before.get("position_m", {}), after.get("position_m", {})
    if not isinstance(was, Mapping) or not isinstance(now, Mapping):
        return {}, inserted
    ways = {name: _distance(was[name], now[name]) for name in was.keys() & now.keys() - inserted}
    return {name: way for name, way in sorted(ways.items()) if way >= _MOVED_M}, inserted


def _distance(one: list[float], other: list[float]) -> float:
    return float(sum((a - b) ** 2 for a, b in zip(one, other, strict=True)) ** 0.5)


def _in_question(rows: tuple[_Row, ...], moved: Mapping[str, float]) -> _Row:
    """Return the fact that the failure is about.

    Of those that do not hold: the one whose object or destination the event moved, or else the one that was
    tried first, or else the first. Closing or turning off comes last, as it does in a task.
    """
    left = [row for row in rows if not row.satisfied] or list(rows)

    def order(row: _Row) -> tuple[bool, bool, float]:
        place = row.place or ""
        touched = row.entity in moved or any(place == name or place.startswith(f"{name}_") for name in moved)
        last = row.goal.startswith(("close", "turnoff"))
        return not touched, last, float("inf") if row.touch_step is None else float(row.touch_step)

    return min(left, key=order)


# Words.


def _words(name: str, instruction: str) -> str:
    """Return the longest part of an entity's name in the instruction, the last of those; or all of it.

    Of a region of an entity, ``wooden_cabinet_1_top_side``, the entity is named.
    """
    parts = re.split(r"_\d+(?:_|$)", name)[0].split("_")
    for length in range(len(parts), 0, -1):
        for first in range(len(parts) - length, -1, -1):
            words = " ".join(parts[first : first + length])
            if re.search(rf"\b{re.escape(words)}s?\b", instruction.lower()):
                return words
    return " ".join(parts)


def _cm(metres: float | None) -> str:
    return "an unknown distance" if metres is None else f"{100 * metres:.1f}".removesuffix(".0") + " cm"


# Rules: a sentence, or None where a cause does not fit.


def _not_stopped(seen: _Seen) -> str | None:
    """The task was cancelled, and the policy moved on or completed it."""
    last = seen.arm.firings[-1] if seen.arm.firings else None
    if last is None or last.evidence["operation"] != _CANCELS:
        return None
    if seen.arm.response_step is None:
        return f"The task was cancelled at step {last.step}, and the policy was not asked again."
    end = " The cancelled goal holds at the end." if seen.done == seen.facts else ""
    return (
        f"The task was cancelled at step {last.step}. The policy was told at step {seen.arm.response_step}, "
        f"and did not stand still from then on, or completed the task.{end}"
    )


def _not_attempted(seen: _Seen) -> str | None:
    """The hand never went 5 cm from where it started."""
    reach = seen.stages["reach_m"]
    if reach >= _STARTED_M:
        return None
    return f"The hand never went farther than {_cm(reach)} from where it started{seen.repeats}."


def _missed_moved_target(seen: _Seen) -> str | None:
    """The event moved the object; the hand closed where the object had been."""
    row, event = seen.row, seen.event
    if event is None or row.entity not in seen.moved or seen.lifted:
        return None
    if row.close_step is None or row.close_m is None or row.close_old_m is None:
        return None
    usual = seen.other.close_m if seen.other is not None and seen.other.close_m is not None else 0.0
    off = abs(row.close_old_m - usual)
    if off >= _SAME_PLACE_M and off >= abs(row.close_m - usual):
        return None
    return (
        f"{seen.thing.capitalize()} moved {_cm(seen.moved[row.entity])} at step {event.step}; the hand "
        f"closed at step {row.close_step}, {_cm(row.close_m)} away{seen.in_base}, where it had been."
    )


def _missed_moved_goal(seen: _Seen) -> str | None:
    """The event moved the destination; the object was let go, or held to the end, where that had been."""
    row, event = seen.row, seen.event
    if event is None or seen.mover is None:
        return None
    begin = (
        f"{seen.goal.capitalize()} moved {_cm(seen.moved[seen.mover])} at step {event.step}; {seen.thing} "
    )
    if row.holding and _nearer(row.away_old_m, row.away_m):
        return (
            f"{begin}was still held at the end, {_cm(row.away_m)} from it and {_cm(row.away_old_m)} from "
            f"where it had been before{seen.held_up}."
        )
    if row.lost_open and _nearer(row.lost_old_m, row.lost_m):
        return (
            f"{begin}was let go at step {row.lost_step}, {_cm(row.lost_m)} from it, where it had been before."
        )
    return None


def _nearer(one: float | None, other: float | None) -> bool:
    return one is not None and other is not None and one < other


def _blocked_by_obstacle(seen: _Seen) -> str | None:
    """The hand was told to move for 2 s or more and did not; it touched what has no part in the task."""
    number = int(seen.stages["blocked_steps"])
    owner = seen.row.place or ""
    names = [
        name
        for name in seen.stages["blocked_by"]
        if name != seen.row.entity and not owner.startswith(name) and not _is_surface(name)
    ]
    if number < _BLOCKED_STEPS or not names:
        return None
    inserted = [name for name in names if name in seen.inserted]
    what = " and ".join(_words(name, "") for name in inserted or names)
    put = f" that {'was' if len(inserted) == 1 else 'were'} put there" if inserted else ""
    first = seen.stages["blocked_step"]
    return seen.after_event(
        f"the hand pushed against the {what}{put} from step {first} on, for {number} steps, without moving."
    )


def _is_surface(name: str) -> bool:
    return name.endswith(("table", "floor"))


def _froze_after_event(seen: _Seen) -> str | None:
    """The hand stopped within half a second of the first answer to the event, for good. Base moved on."""
    event, base = seen.event, seen.base
    if event is None or base is None or seen.still < _STILL_STEPS or seen.row.holding:
        return None
    answered = event.step if seen.arm.response_step is None else event.step + (seen.arm.stale_actions or 0)
    stopped = int(seen.stages["still_step"])
    there = None if seen.other is None or seen.other.closest_m is None else seen.other.closest_m + _ARRIVED_M
    if there is not None and seen.row.closest_m is not None and seen.row.closest_m <= there:
        return None
    if stopped > answered + _REACTION_STEPS or base.steps <= stopped:
        return None
    return seen.after_event(
        f"the hand stopped at step {stopped}, at least {_cm(seen.row.closest_m)} from {seen.thing}, and "
        f"stayed there until step {seen.steps}{seen.repeats}."
    )


def _wrong_object(seen: _Seen) -> str | None:
    """The fingers lifted another object, and not the one of the task."""
    if seen.lifted or not seen.stages["wrong"]:
        return None
    name, step = seen.stages["wrong"][0], seen.stages["wrong_step"][0]
    what = _words(name, "")
    other = f"another {what} ({name})" if what == _words(seen.row.entity, "") else f"the {what}"
    return seen.after_event(f"the hand lifted {other} at step {step}, and never {seen.thing}.")


def _hit_obstacle(seen: _Seen) -> str | None:
    """The robot pushed away what the event had put there, and never lifted the object of the task."""
    if seen.lifted:
        return None
    pushed = [
        (step, name, way)
        for name, step, way in zip(
            *(seen.stages[key] for key in ("moved", "moved_step", "moved_m")), strict=True
        )
        if name in seen.inserted and seen.event is not None and step > seen.event.step + _REACTION_STEPS
    ]
    if not pushed:
        return None
    step, name, way = min(pushed)
    over = ", knocked over" if name in seen.stages["toppled"] else ""
    return seen.after_event(
        f"the {_words(name, '')} that was put there was pushed {_cm(way)}{over} from step {step} on, and "
        f"{seen.thing} was never lifted."
    )


def _moved_goal(seen: _Seen) -> str | None:
    """The robot grasped the object, and moved the destination 5 cm or more, or knocked it over."""
    row, stages, place = seen.row, seen.stages, seen.row.place or ""
    if row.grasp_step is None:
        return None
    for name, step, way in zip(*(stages[key] for key in ("moved", "moved_step", "moved_m")), strict=True):
        toppled = name in stages["toppled"]
        if (place == name or place.startswith(f"{name}_")) and (toppled or way >= _PUSHED_M):
            over = " and knocked over" if toppled else ""
            return seen.after_event(f"{seen.goal} was pushed {_cm(way)}{over}, from step {step} on.")
    if not row.lost_open or row.lost_m is None or row.away_m is None or row.strayed_m is None:
        return None
    if row.lost_m > _PUSHED_M or row.strayed_m > _MOVED_M or row.away_m - row.lost_m < _PUSHED_M:
        return None
    return seen.after_event(
        f"{seen.thing} was let go at step {row.lost_step}, {_cm(row.lost_m)} from its place at {seen.goal}, "
        f"which moved afterwards and ended {_cm(row.away_m)} from it."
    )


def _undone(seen: _Seen) -> str | None:
    """The fact of the goal held once, and not at the end."""
    row = seen.row
    if row.satisfied_step is None or row.satisfied:
        return None
    return seen.after_event(f"'{row.goal}' held at step {row.satisfied_step} and does not at the end.")


def _timed_out_holding(seen: _Seen) -> str | None:
    """The time was up with the object in the hand."""
    row = seen.row
    if not row.holding:
        return None
    away = "" if row.away_m is None else f", {_cm(row.away_m)} from {seen.goal}"
    return seen.after_event(
        f"the hand still held {seen.thing}, lifted at step {row.lift_step}, when the time was up at step "
        f"{seen.steps}{away}."
    )


def _grasp_slipped(seen: _Seen) -> str | None:
    """The object left the fingers though they were closed, or was not lifted by them."""
    row = seen.row
    if seen.lifted and row.lost_open is False:
        away = "" if row.lost_m is None else f", {_cm(row.lost_m)} from {seen.goal}"
        return seen.after_event(
            f"{seen.thing} slipped out of closed fingers at step {row.lost_step}{away}, after a lift of "
            f"{_cm(row.lift_m)}."
        )
    if not seen.lifted and row.grasp_step is not None and (seen.event is None or not seen.moved):
        return seen.after_event(
            f"both fingers were on {seen.thing} at step {row.grasp_step}, and did not lift it."
        )
    return None


def _let_go(seen: _Seen) -> str:
    row = seen.row
    fell = row.fell_m or 0.0
    down = f", {_cm(fell)} above where it ended" if fell >= _FALL_M else ""
    return seen.after_event(
        f"{seen.thing} was let go at step {row.lost_step}, {_cm(row.lost_m)} from {seen.goal}{down}; it "
        f"ended {_cm(row.away_m)} from it."
    )


def _dropped(seen: _Seen) -> str | None:
    """The fingers opened 5 cm or more above where the object ended, 5 cm or more from the destination."""
    row = seen.row
    falls = (row.fell_m or 0.0) >= _FALL_M and (row.away_m or 0.0) >= _FALL_M
    return _let_go(seen) if seen.lifted and row.lost_m is not None and falls else None


def _placed_elsewhere(seen: _Seen) -> str | None:
    """The fingers put the object down 15 cm or more from the destination."""
    far = seen.row.lost_m is not None and seen.row.lost_m >= _FAR_FROM_GOAL_M
    return _let_go(seen) if seen.lifted and far else None


def _placed_beside_goal(seen: _Seen) -> str | None:
    """The fingers opened near the destination, and the fact of the goal does not hold."""
    return _let_go(seen) if seen.lifted and seen.row.lost_m is not None else None


def _toppled_target(seen: _Seen) -> str | None:
    """The object leans by 45 degrees or more and was never lifted."""
    if seen.lifted or (seen.row.tilt_deg or 0.0) < _TOPPLED_DEG:
        return None
    return seen.after_event(f"{seen.thing} was knocked over: it leans by {seen.row.tilt_deg:.0f} degrees.")


def _pushed_target(seen: _Seen) -> str | None:
    """The object was pushed 5 cm or more and never lifted."""
    if seen.lifted or (seen.row.shift_m or 0.0) < _PUSHED_M:
        return None
    return seen.after_event(f"{seen.thing} was pushed {_cm(seen.row.shift_m)} and never lifted.")


def _grasp_missed(seen: _Seen) -> str | None:
    """The hand closed near the object without getting hold of it."""
    row = seen.row
    if seen.lifted or row.close_step is None or row.close_m is None or row.close_m > seen.near_m + _BESIDE_M:
        return None
    return seen.after_event(
        f"the hand closed at step {row.close_step}, {_cm(row.close_m)} from {seen.thing}{seen.in_base}, and "
        "did not get hold of it."
    )


def _stuck(seen: _Seen) -> str | None:
    """The hand was told to move for 2 s or more and did not, around the object and before a lift."""
    row = seen.row
    if seen.lifted or not seen.held_up or row.closest_m is None or row.closest_m > seen.near_m + _AROUND_M:
        return None
    return seen.after_event(
        f"the hand came within {_cm(row.closest_m)} of {seen.thing}{seen.held_up}, from step "
        f"{seen.stages['blocked_step']} on."
    )


def _never_closed(seen: _Seen) -> str | None:
    """The hand reached the object and did not close."""
    row = seen.row
    if seen.lifted or not seen.reached or row.travel is not None:
        return None
    return seen.after_event(
        f"the hand came within {_cm(row.closest_m)} of {seen.thing} at step {row.closest_step} and did not "
        "close."
    )


def _part_not_moved(seen: _Seen) -> str | None:
    """The hand reached the drawer, door or knob, which hardly moved."""
    row = seen.row
    if row.travel is None or row.travel >= _PART_MOVED or not (seen.reached or row.touch_step is not None):
        return None
    return seen.after_event(
        f"the hand came within {_cm(row.closest_m)} of {seen.thing} at step {row.closest_step}, but "
        "it did not move."
    )


def _part_moved_too_little(seen: _Seen) -> str | None:
    """The drawer, door or knob moved, but not far enough."""
    row = seen.row
    if row.travel is None or row.travel < _PART_MOVED:
        return None
    way = _cm(row.travel_m) if row.travel_rad is None else f"{math.degrees(row.travel_rad):.0f} degrees"
    return seen.after_event(f"{seen.thing} moved by {way}, which is not enough for '{row.goal}'.")


def _timed_out(seen: _Seen) -> str | None:
    """The time was up while the hand was on its way."""
    row = seen.row
    free = row.touch_step is None and int(seen.stages["blocked_steps"]) < _BLOCKED_STEPS
    late = seen.base is not None and (row.closest_step or 0) >= seen.steps - _REACTION_STEPS
    nearing = late and not seen.reached
    if not free or not (nearing or (seen.done and seen.still < _STILL_STEPS)):
        return None
    done = f", with {seen.done} of {seen.facts} facts of the goal done" if seen.facts > 1 else ""
    return seen.after_event(
        f"the time was up at step {seen.steps}{done}, when the hand had come within {_cm(row.closest_m)} of "
        f"{seen.thing}."
    )


def _froze(seen: _Seen) -> str | None:
    """The hand stopped before it reached the object, with a quarter of the time left."""
    if seen.reached or seen.held_up or 4 * seen.still < seen.record.max_steps:
        return None
    return seen.after_event(
        f"the hand stopped at step {seen.stages['still_step']} and stayed there until step {seen.steps}; it "
        f"had come within {_cm(seen.row.closest_m)} of {seen.thing}{seen.repeats}."
    )


def _never_reached(seen: _Seen) -> str:
    """The hand did not come near the object."""
    row = seen.row
    return seen.after_event(
        f"the hand came no closer to {seen.thing} than {_cm(row.closest_m)}, at step {row.closest_step}"
        f"{seen.held_up}."
    )


_RULES: tuple[tuple[str, Callable[[_Seen], str | None]], ...] = tuple(
    (rule.__name__.removeprefix("_"), rule)
    for rule in (
        _not_stopped,
        _not_attempted,
        _missed_moved_target,
        _missed_moved_goal,
        _blocked_by_obstacle,
        _froze_after_event,
        _wrong_object,
        _hit_obstacle,
        _timed_out_holding,
        _moved_goal,
        _undone,
        _toppled_target,
        _pushed_target,
        _grasp_slipped,
        _dropped,
        _placed_elsewhere,
        _placed_beside_goal,
        _part_moved_too_little,
        _part_not_moved,
        _timed_out,
        _grasp_missed,
        _stuck,
        _never_closed,
        _froze,
        _never_reached,
    )
)
"""The rules in their order; the last one always fits."""

CAUSES: Mapping[str, str] = {
    NOT_RECORDED: "The record holds no stages: it was written before there were any.",
    "already_failing_in_base": "Base failed as well.",
    **{cause: " ".join((rule.__doc__ or "").split()) for cause, rule in _RULES},
}
"""Every cause with its meaning. That of an arm is the first that fits, in this order."""
