"""A failed arm as the rules for causes see it: how far it came at each stage, beside Base."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from pytest_libero_max.events.schedules import BASE
from pytest_libero_max.pairing.record import ArmRecord, FiringRecord, PairRecord
from pytest_libero_max.report.happenings import happenings, happenings_text

_HOLDS = {
    "on": "{thing} was on {place}",
    "in": "{thing} was in {place}",
    "open": "{thing} was open",
    "close": "{thing} was closed",
    "turnon": "{thing} was on",
    "turnoff": "{thing} was off",
}
"""Clauses on a fact that held, by LIBERO's predicate."""

_AIMS = {"open": "to open it", "close": "to close it", "turnon": "to turn it on", "turnoff": "to turn it off"}

_SIDES = {"right": "to the right of", "left": "to the left of", "front": "in front of", "back": "behind"}

_PARTS = (
    (r"(?P<entity>\w*cabinet\w*?_\d+)_(?P<part>top|middle|bottom)_region", "the {part} drawer of {entity}"),
    (r"(?P<entity>\w+?_\d+)_top_side", "the top of {entity}"),
    (r"(?P<entity>\w+?_\d+)_(?P<part>back|front|left|right)_contain_region", "the {part} part of {entity}"),
    (r"(?P<entity>\w+?_\d+)(?:_\w+)?", "{entity}"),
    (r"\w*table_(?P<entity>\w+)_(?P<side>right|left|front|back)_region", "the table {side} {entity}"),
    (r"\w*table\w*", "the table"),
)
"""Regions of a goal by the form of their names, and their words."""


def name_in_words(name: str, instruction: str) -> str:
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


def place_in_words(name: str, instruction: str) -> str:
    """Return an entity, or a region of one or of a table, in words with an article."""
    for form, words in _PARTS:
        if (match := re.fullmatch(form, name)) is not None:
            groups = match.groupdict()
            side = _SIDES.get(groups.get("side", ""), "")
            entity = f"the {name_in_words(groups.get('entity', ''), instruction)}"
            return words.format(entity=entity, part=groups.get("part", ""), side=side)
    return f"the {name_in_words(name, instruction)}"


def fact_in_words(fact: str, instruction: str) -> str:
    """Return a clause that says that a fact of a goal held, for example ``the drawer was open``.

    Args:
        fact: As a record has it: ``in akita_black_bowl_1 white_cabinet_1_bottom_region``.
        instruction: Of the task, whose words are used.
    """
    predicate, *names = fact.split(" ")
    words = [place_in_words(name, instruction) for name in names]
    if predicate not in _HOLDS or not words:
        return f"the goal held for {place_in_words(fact.replace(' ', '_'), instruction)}"
    return _HOLDS[predicate].format(thing=words[0], place=words[-1])


def aim_in_words(fact: str) -> str:
    """Return what a movement was for, for example ``to open it``."""
    return _AIMS.get(fact.partition(" ")[0], "for the goal")


STAGES = "stages"
"""Name of the probe that the rules read."""

BLOCKED_STEPS = 40
"""Policy steps (2 s) for which a hand that pushes without moving is held up."""

MOVED_M = 0.02
"""Distance from which an object counts as moved by a change."""

_CLOSING_STEPS = 20  # after which a hand that began to close holds something
_NEAR_M = 0.12  # distance of a hand that has reached an object, where no Base says how near that is
_REACHED_MORE_M = 0.02  # how much farther than in a Base that succeeded the hand may be


@dataclass(frozen=True)
class Row:
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
    carried_m: float
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
        """Way of a drawer, door or knob, m or rad; None where the fact has none, or it was not recorded."""
        return self.travel_m if self.travel_rad is None else self.travel_rad

    @property
    def place(self) -> str | None:
        """The destination, as the goal spells it; None for a drawer, door or knob."""
        words = self.goal.split(" ")
        return words[2] if len(words) == 3 else None

    @property
    def is_part(self) -> bool:
        """True if the fact is about a drawer, a door or a knob."""
        return len(self.goal.split(" ")) == 2


def has_stages(arm: ArmRecord) -> bool:
    """Return True if the record of an arm holds the columns of the rules."""
    stages = arm.probes.get(STAGES, {})
    return {field.name for field in fields(Row)} <= stages.keys() and bool(stages["goal"])


def _rows(stages: Mapping[str, Any]) -> tuple[Row, ...]:
    names = [field.name for field in fields(Row)]
    return tuple(Row(*values) for values in zip(*(stages[name] for name in names), strict=True))


@dataclass(frozen=True)
class FailedArm:
    """A failed arm, and Base where that succeeded."""

    record: PairRecord
    played: ArmRecord
    stages: Mapping[str, Any]
    """The columns about the hand and about other objects."""
    rows: tuple[Row, ...]
    row: Row
    """The fact that the failure is about."""
    base: ArmRecord | None
    """Base, where it succeeded and is another arm; otherwise None."""
    base_rows: Mapping[str, Row]
    """Its facts, by their words."""
    event: FiringRecord | None
    """The first firing that did not only wait, or None."""
    happened: str
    """Everything that happened, as the beginning of a sentence; empty where nothing did."""
    moved: Mapping[str, float]
    """Objects that it moved, with the distance, m."""
    inserted: frozenset[str]

    @classmethod
    def of(cls, record: PairRecord, played: ArmRecord) -> FailedArm:
        """Return a failed arm of a pair that holds its stages."""
        base = record.arms.get(BASE)
        if base is None or base is played or not base.success or not has_stages(base):
            base = None
        changes = happenings(record, played)
        event = changes[0].firing if changes else None
        moved, inserted = _moves(event)
        stages = played.probes[STAGES]
        rows = _rows(stages)
        base_rows = {} if base is None else {row.goal: row for row in _rows(base.probes[STAGES])}
        row = _in_question(rows, moved, base_rows)
        return cls(
            record,
            played,
            stages,
            rows,
            row,
            base,
            base_rows,
            event,
            happenings_text(changes),
            moved,
            inserted,
        )

    # Names and clauses.

    @property
    def thing(self) -> str:
        """The object or part in question, in words."""
        words = self.row.goal.split(" ")
        return f"the {name_in_words(words[1] if words[1:] else self.row.entity, self.record.instruction)}"

    @property
    def goal(self) -> str:
        """The destination in question, in words."""
        return f"the {name_in_words(self.row.place or '', self.record.instruction)}"

    @property
    def repeats(self) -> str:
        """A clause about answers that repeat, or nothing."""
        number = int(self.stages["repeated_queries"])
        return f"; the last {number} queries got the answer of the one before" if number >= 3 else ""

    @property
    def held_up(self) -> str:
        """A clause about a hand that was held up, or nothing."""
        number = int(self.stages["blocked_steps"])
        if number < BLOCKED_STEPS:
            return ""
        names = " and ".join(f"the {name_in_words(name, '')}" for name in self.stages["blocked_by"])
        by = f" by {names}" if names else ", though it touched nothing"
        return f"; it was held up for {number} steps{by}"

    def in_base(self, value_m: float | None) -> str:
        """Return a distance of Base in brackets; nothing where there is none."""
        return "" if value_m is None else f" ({cm(value_m)} in Base)"

    def after_event(self, text: str) -> str:
        """Return a sentence that begins with what happened, where something did."""
        return f"{self.happened}; {text}" if self.happened else text[0].upper() + text[1:]

    # Stages.

    @property
    def base_row(self) -> Row | None:
        """The fact in question in Base; None where no Base succeeded."""
        return self.base_rows.get(self.row.goal)

    @property
    def steps(self) -> int:
        return self.played.steps

    @property
    def done(self) -> list[Row]:
        """Facts that hold at the end."""
        return [row for row in self.rows if row.satisfied]

    @property
    def mover(self) -> str | None:
        """The object at or in which the destination is, where the event moved it."""
        place = self.row.place or ""
        return next((name for name in self.moved if is_at(place, name)), None)

    @property
    def answered(self) -> int:
        """Policy steps executed when the first answer to the event began; 0 without an event."""
        if self.event is None:
            return 0
        if self.played.response_step is None:
            return self.event.step
        return self.event.step + (self.played.stale_actions or 0)

    @property
    def lifted(self) -> bool:
        """True if the object was lifted, or held, after the event; what an open hand moves is not."""
        row, event = self.row, self.event
        if not row.holding and self._is_open_handed:
            return False
        last = max((step for step in (row.lift_step, row.lost_step) if step is not None), default=-1)
        return last >= 0 and (row.holding or event is None or last > event.step or not self.moved)

    @property
    def _is_open_handed(self) -> bool:
        """True if the hand was open when the object rose. Closings are known from the last change on."""
        lift, usual = self.row.lift_step, self.base_row.close_step if self.base_row is not None else None
        if self.row.close_step is not None or lift is None:
            return False
        changed = self.played.firings[-1].step if self.played.firings else 0
        return lift > changed and ((usual or 0) > changed or lift > changed + _CLOSING_STEPS)

    @property
    def grasped(self) -> bool:
        """True if both fingers touched the object after the event."""
        step = self.row.grasp_step
        return step is not None and (self.event is None or not self.moved or step > self.event.step)

    @property
    def farther_m(self) -> float | None:
        """Distance by which the hand stayed farther from the object than one that has reached it, m."""
        if self.row.closest_m is None:
            return None
        usual = None if self.base_row is None else self.base_row.closest_m
        return self.row.closest_m - (_NEAR_M if usual is None else usual + _REACHED_MORE_M)

    @property
    def reached(self) -> bool:
        """True if the hand came as near to the object as in Base, to 2 cm."""
        return self.farther_m is not None and self.farther_m <= 0.0

    @property
    def still(self) -> int:
        """Number of steps at the end during which the hand stayed where it ends."""
        return self.steps - int(self.stages["still_step"])

    @property
    def stopped(self) -> bool:
        """True if the hand stayed where it ends for the last quarter of the time."""
        return 4 * self.still >= self.record.max_steps

    @property
    def was_blocked(self) -> bool:
        """True if the hand was held up for 2 s more than in Base, and for half of the time from then on."""
        first, number = self.stages["blocked_step"], int(self.stages["blocked_steps"])
        usual = 0 if self.base is None else int(self.base.probes[STAGES]["blocked_steps"])
        return number >= BLOCKED_STEPS + usual and 2 * number >= self.steps - first

    def base_took(self, first: str, then: str) -> int | None:
        """Return the steps that Base took from one stage of the fact to a later one, by their columns."""
        row = self.base_row
        if row is None or self.base is None:
            return None
        begin = getattr(row, first)
        end = getattr(row, then)
        end = self.base.steps if end is None and then == "lost_step" else end
        return end - begin if begin is not None and end is not None and end >= begin else None


def is_at(place: str, name: str) -> bool:
    """Return True if a destination is an entity or a region of it."""
    return place == name or place.startswith(f"{name}_")


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
    return {name: way for name, way in sorted(ways.items()) if way >= MOVED_M}, inserted


def _distance(one: list[float], other: list[float]) -> float:
    return float(sum((a - b) ** 2 for a, b in zip(one, other, strict=True)) ** 0.5)


def _in_question(rows: tuple[Row, ...], moved: Mapping[str, float], base: Mapping[str, Row]) -> Row:
    """Return the fact that the failure is about.

    Of those that do not hold: the one whose object or destination the event moved, or else the one that was
    tried first, or that Base tried first, or else the first. Closing or turning off comes last, as it does in
    a task.
    """
    left = [row for row in rows if not row.satisfied] or list(rows)

    def order(row: Row) -> tuple[bool, bool, float, float]:
        place = row.place or ""
        touched = row.entity in moved or any(is_at(place, name) for name in moved)
        last = row.goal.startswith(("close", "turnoff"))
        usual = base.get(row.goal, row).touch_step
        return not touched, last, _or_never(row.touch_step), _or_never(usual)

    return min(left, key=order)


def _or_never(step: int | None) -> float:
    return float("inf") if step is None else float(step)


# Words.


def cm(metres: float | None) -> str:
    """Return a length in centimetres, in words where it is unknown."""
    return "an unknown distance" if metres is None else f"{100 * metres:.1f}".removesuffix(".0") + " cm"
