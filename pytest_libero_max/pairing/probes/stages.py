"""Stages of an arm: what the hand and the objects of the task did, and when."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from pytest_libero_max.errors import EntityError
from pytest_libero_max.events.triggers import ABOVE_RADIUS_M, distance_m
from pytest_libero_max.pairing.probes.probe import Column, Probe, View
from pytest_libero_max.pairing.trajectory import Firing, Step
from pytest_libero_max.tasks.contents import owner
from pytest_libero_max.worlds.contract import Array, World
from pytest_libero_max.worlds.privileged import Fact, PrivilegedWorld
from pytest_libero_max.worlds.robot import GRIPPER, ROBOT

Point = tuple[float, ...]

SAMPLE_STEPS = 5
"""Policy steps between two samples of the measurements that take more than a few microseconds."""

STILL_M = 0.01
"""A hand that stays within this distance of where it ends has stopped."""

LIFTED_M = 0.01
"""Height above its resting place from which an object counts as off its support."""

MOVED_M = 0.02
"""Distance from which an object counts as moved."""

_CARRIED_M = 0.03  # way after which a held object that was not raised is asked for its contacts
_NEAR_M = 0.3  # an object whose origin is farther from the hand than this cannot be between the fingers
_LOOSE_STEPS = 3  # steps with one finger on it after which an object counts as lost
_OPENING_STEPS = 5  # the fingers take as long to let go
_PUSHING = 0.25  # mean movement asked for, in units of the action, of a hand that wants to move
_PUSHING_M = 0.03  # likewise under absolute control
_LOOK_STEPS = 4 * SAMPLE_STEPS  # all contacts take 0.4 ms
_HELD_UP_M = 0.005  # a hand that moves less in a sample is held up


@dataclass(frozen=True, slots=True)
class Track:
    """One fact of the goal, and how far the arm has come with what it is about."""

    fact: Fact | None
    """The fact; None where the world does not tell its goal, and the trigger entity is followed."""
    entity: str
    """The object of the fact, or the fixture that it is a part of."""
    part: bool
    """True for a drawer, a door or a knob."""
    rest: Point
    """(3,) m: where the object rests, or the part was."""
    start: Point = ()
    """Joint positions of the part, or of the drawer or door that the destination is behind."""
    old: Point | None = None
    """(3,) m: where the object rested before a change moved it, or None."""
    old_place: Point | None = None
    """(2,) m: where its destination was before a change moved that, or None."""
    at: Point = ()
    """(3,) m: where the object was when both fingers touched it last."""
    held: bool = False
    lifted: bool = False
    """True if it has been lifted since they do."""
    loose: int = 0
    """Steps since both fingers touched it."""
    # Columns.
    satisfied_step: int | None = None
    closest_m: float = math.inf
    closest_step: int = 0
    touch_step: int | None = None
    close_step: int | None = None
    close_m: float | None = None
    close_old_m: float | None = None
    grasp_step: int | None = None
    lift_step: int | None = None
    lift_m: float = 0.0
    carried_m: float = 0.0
    above_step: int | None = None
    lost_step: int | None = None
    lost_open: bool | None = None
    lost_m: float | None = None
    lost_old_m: float | None = None
    lost_at: Point = ()
    travel: float = 0.0


@dataclass(frozen=True, slots=True)
class State:
    """All that has been seen of an arm."""

    tracks: tuple[Track, ...]
    """Facts of the goal, in its order."""
    hand: Point
    """(3,) m: where the hand started."""
    objects: tuple[tuple[str, Point, Point], ...]
    """Each object with where it rests and what of it points up there."""
    moved: tuple[tuple[str, int], ...] = ()
    """Other objects that have left that place, with the step."""
    wrong: tuple[tuple[str, int], ...] = ()
    """Other objects that were lifted, with the step."""
    blocked: tuple[int | None, int, tuple[str, ...]] = (None, 0, ())
    """First step at which the hand was held up, or None, the number of steps, and by what."""
    firings: int = 0
    """Number of firings that the above knows of."""


def _of_goal(
    name: str,
    kind: Any,
    meaning: str,
    unit: str | None = None,
    optional: bool = True,
    least: float | None = 0,
) -> Column:
    text = f"For each fact of the goal: {meaning}"
    least = None if unit is None else least
    return Column(name, kind, text, unit, many=True, optional=optional, least=least, along="goal")


def _step(name: str, meaning: str, **more: Any) -> Column:
    return Column(name, "int", meaning, "steps", least=0, **more)


_OF_GOAL = (
    Column(
        "goal", "str", "Facts of the goal; the trigger entity where a world does not tell its goal", many=True
    ),
    _of_goal("entity", "str", "the object, or the fixture of a drawer, door or knob", optional=False),
    _of_goal("satisfied", "bool", "True if it holds at the end", optional=False),
    _of_goal("satisfied_step", "int", "first step at which it held, looked at every fifth step", "steps"),
    _of_goal("closest_m", "float", "smallest distance of the hand", "m"),
    _of_goal("closest_step", "int", "its step", "steps"),
    _of_goal("touch_step", "int", "first step with a finger on it", "steps"),
    _of_goal("close_step", "int", "step at which the gripper began to close nearest to it", "steps"),
    _of_goal("close_m", "float", "distance of the hand then", "m"),
    _of_goal("close_old_m", "float", "distance of the hand then to where it was before a change", "m"),
    _of_goal("grasp_step", "int", "first step with both fingers on it", "steps"),
    _of_goal("lift_step", "int", "first step at which they held it off its support", "steps"),
    _of_goal("lift_m", "float", "greatest height above its place while held", "m", optional=False),
    _of_goal(
        "carried_m", "float", "greatest horizontal distance from its place while held", "m", optional=False
    ),
    _of_goal("above_step", "int", "first step at which it was held within 8 cm of its destination", "steps"),
    _of_goal("lost_step", "int", "last step at which it left the fingers after a lift", "steps"),
    _of_goal("lost_open", "bool", "True if the gripper was being opened then"),
    _of_goal("lost_m", "float", "horizontal distance from its destination then", "m"),
    _of_goal("lost_old_m", "float", "that from where the destination was before a change", "m"),
    _of_goal("fell_m", "float", "its height then above its height at the end", "m", least=None),
    _of_goal("holding", "bool", "True if the fingers hold it at the end", optional=False),
    _of_goal("away_m", "float", "horizontal distance from its destination at the end", "m"),
    _of_goal("away_old_m", "float", "that from where the destination was before a change", "m"),
    _of_goal("strayed_m", "float", "horizontal distance from where it was let go, at the end", "m"),
    _of_goal(
        "shift_m", "float", "distance from where it rested at the start or after a change, at the end", "m"
    ),
    _of_goal("tilt_deg", "float", "by how much it leans at the end more than at the start", "deg"),
    _of_goal(
        "travel_m",
        "float",
        "greatest way of the joint of a drawer, of an object of the one that it goes into",
        "m",
    ),
    _of_goal("travel_rad", "float", "likewise of a door or knob", "rad"),
)


class Stages(Probe[State]):
    """Progress of the arm with each fact of the goal, and movements of the hand beside it.

    Objects are where their origin is. A change in the arm begins the approach anew: the columns ``closest_*``
    and ``close_*`` are about the time after it.
    """

    name = "stages"
    schema = (
        *_OF_GOAL,
        Column("reach_m", "float", "Greatest distance of the hand from where it started", "m", least=0),
        _step("still_step", "Step from which the hand stayed within 1 cm of where it ends"),
        Column(
            "repeated_queries",
            "int",
            "Number of queries at the end whose answers equal the one before",
            least=0,
        ),
        _step("blocked_step", "First step at which the hand was told to move and did not", optional=True),
        _step("blocked_steps", "Number of such steps, in fives"),
        Column("blocked_by", "str", "Names of what the robot, or what it holds, touched then", many=True),
        Column("moved", "str", "Other objects that moved by 2 cm or more", many=True),
        _step("moved_step", "Step of each, to five", many=True, along="moved"),
        Column(
            "moved_m",
            "float",
            "Distance of each from its place at the end",
            "m",
            many=True,
            least=0,
            along="moved",
        ),
        Column("toppled", "str", "Objects that lean by 45 degrees or more", many=True),
        Column("wrong", "str", "Other objects that the fingers lifted", many=True),
        _step("wrong_step", "Step of each, to five", many=True, along="wrong"),
    )
    cost = "0.05 ms a step on the embedded substrate"

    def start(self, view: View) -> State:
        """Places of everything, before the first step."""
        world = view.world
        return State(_tracks(view), _point(world.end_effector()), rests_of(world))

    def step(self, state: State, view: View) -> State:
        """Follow the objects of the goal; everything else every fifth step."""
        trajectory = view.trajectory
        if len(trajectory.firings) != state.firings:
            state = _after_change(state, view)
        last = trajectory.executed[-1]
        closes_at = view.world.robot.closes
        closes = closes_at(last.action) and (
            len(trajectory.executed) == 1 or not closes_at(trajectory.executed[-2].action)
        )
        tracks = tuple(
            [track if track.part else _follow(track, view, last, closes) for track in state.tracks]
        )
        if trajectory.step % SAMPLE_STEPS == 0:
            return _sample(replace(state, tracks=tracks), view, last)
        if all(new is old for new, old in zip(tracks, state.tracks, strict=True)):
            return state
        return replace(state, tracks=tracks)

    def columns(self, state: State, view: View) -> Mapping[str, Any]:
        """All that was seen, and the end."""
        trajectory = view.trajectory
        if len(trajectory.firings) != state.firings:
            state = _after_change(state, view)
        rows = [_row(track, state, view) for track in state.tracks]
        moved = dict(state.moved)
        rests = {name: (rest, up) for name, rest, up in state.objects}
        now = {name: rest_of(view.world, name) for name in rests}
        ends = {name: distance_m(np.array(at), np.array(rests[name][0])) for name, (at, _) in now.items()}
        subjects = {track.entity for track in state.tracks}
        others = [name for name in rests if name not in subjects and ends[name] >= MOVED_M]
        step, steps, blockers = state.blocked
        reaches = [distance_m(s.end_effector, np.array(state.hand)) for s in trajectory.executed]
        return {
            **{column: [row[column] for row in rows] for column in (column.name for column in _OF_GOAL)},
            "reach_m": _metres(max(reaches, default=0.0)),
            "still_step": _still_step(trajectory.executed),
            "repeated_queries": _repeated(view),
            "blocked_step": step,
            "blocked_steps": steps,
            "blocked_by": blockers,
            "moved": others,
            "moved_step": [moved.get(name, trajectory.step) for name in others],
            "moved_m": [_metres(ends[name]) for name in others],
            "toppled": [name for name, (_, up) in now.items() if tilt_deg(up, rests[name][1]) >= 45.0],
            "wrong": [name for name, _ in state.wrong],
            "wrong_step": [number for _, number in state.wrong],
        }


# The goal.


def goal_entities(view: View) -> tuple[str, ...]:
    """Return the objects of the goal, and the fixtures of its drawers, doors and knobs, each once."""
    return tuple(dict.fromkeys(track.entity for track in _tracks(view)))


def _tracks(view: View) -> tuple[Track, ...]:
    """Return the facts of the goal as nothing has happened with them."""
    world = view.world
    if not isinstance(world, PrivilegedWorld):
        return (Track(None, view.entity, False, _point(world.position(view.entity))),)
    return tuple(_track(world, fact) for fact in _goal(world))


def _goal(world: PrivilegedWorld) -> tuple[Fact, ...]:
    """Return the facts of the goal that are about entities."""
    return tuple(fact for fact in world.goal if owner_of(world, fact.subject) in world.entities)


def _track(world: PrivilegedWorld, fact: Fact) -> Track:
    entity = owner_of(world, fact.subject)
    if fact.place is None:
        return Track(fact, entity, True, _point(_part(world, fact)), _joints(world, fact))
    return Track(fact, entity, False, _point(world.position(entity)), _joints(world, fact))


def owner_of(world: World, place: str) -> str:
    """Return the entity that a place belongs to; the place itself where there is none."""
    return owner(place, world.entities) or place


def _joint_names(world: PrivilegedWorld, fact: Fact) -> tuple[str, ...]:
    """Joints of a part, or of what the destination of an object is behind; none of an open place."""
    if fact.place is None:
        return world.joints(fact.subject)
    return () if fact.place in world.entities else world.joints(fact.place)


def _joints(world: PrivilegedWorld, fact: Fact) -> Point:
    return tuple(world.joint_position(name) for name in _joint_names(world, fact))


def _is_hinged(world: PrivilegedWorld, fact: Fact) -> bool:
    return any(world.is_hinge(name) for name in _joint_names(world, fact))


def _part(world: PrivilegedWorld, fact: Fact) -> Array:
    """Position of what must be moved for a fact without a place: the handle or knob if one is known."""
    joints = world.joints(fact.subject)
    for part in world.graspable_parts.values():
        if part.joint in joints:
            return world.part_position(part)
    return _place(world, fact.subject)


def _place(world: World, place: str) -> Array:
    """Position of an entity or of a region."""
    if place not in world.entities:
        middle = cast(PrivilegedWorld, world).region(place)
        if middle is not None:
            return middle
        place = owner_of(world, place)
    return world.position(place)


def _away_m(track: Track, world: World, at: Sequence[float]) -> float | None:
    """Horizontal distance of a point from the destination of a track, m."""
    if track.fact is None or track.fact.place is None:
        return None
    try:
        place = _place(world, track.fact.place)
    except EntityError:  # neither a region nor at an entity
        return None
    return math.hypot(at[0] - float(place[0]), at[1] - float(place[1]))


# Each step.


def _follow(track: Track, view: View, last: Step, closes: bool) -> Track:
    """Return the track of an object after one more step."""
    world, step = view.world, view.trajectory.step
    if track.entity == view.entity:
        position, distance = last.entity, last.distance_m
    else:
        position = world.position(track.entity)
        distance = distance_m(last.end_effector, position)
    if distance < track.closest_m:
        track = replace(track, closest_m=distance, closest_step=step)
    if closes:
        track = _closing(track, last, distance, step)
    fingers = world.fingers_on(track.entity) if distance < _NEAR_M else 0
    if fingers >= 2:
        return _holding(track, world, _point(position), step)
    if track.held:
        loose = track.loose + 1 if fingers else _LOOSE_STEPS
        track = _lost(track, view) if loose >= _LOOSE_STEPS else replace(track, loose=loose)
    if fingers and track.touch_step is None:
        track = replace(track, touch_step=step)
    return track


def _closing(track: Track, last: Step, distance: float, step: int) -> Track:
    """Return the track after the gripper began to close: kept where it was nearer than before."""
    old = None if track.old is None else distance_m(last.end_effector, np.array(track.old))
    known = [gap for gap in (track.close_m, track.close_old_m) if gap is not None]
    if known and min(known) <= min(distance, distance if old is None else old):
        return track
    return replace(track, close_step=step, close_m=distance, close_old_m=old)


def _holding(track: Track, world: World, position: Point, step: int) -> Track:
    """Return the track after a step that leaves both fingers on the object."""
    height = position[2] - track.rest[2]
    way = math.hypot(position[0] - track.rest[0], position[1] - track.rest[1])
    lifted = (
        (track.held and track.lifted) or height > LIFTED_M or (way > _CARRIED_M and _is_free(world, track))
    )
    above = track.above_step
    if above is None and lifted:
        away = _away_m(track, world, position)
        above = step if away is not None and away <= ABOVE_RADIUS_M else None
    return replace(
        track,
        at=position,
        held=True,
        lifted=lifted,
        loose=0,
        touch_step=step if track.touch_step is None else track.touch_step,
        grasp_step=step if track.grasp_step is None else track.grasp_step,
        lift_step=step if track.lift_step is None and lifted else track.lift_step,
        lift_m=max(track.lift_m, height),
        carried_m=max(track.carried_m, way) if lifted else track.carried_m,
        above_step=above,
    )


def _is_free(world: World, track: Track) -> bool:
    """Tell whether an object does not touch what it rested on: it was taken off without being raised."""
    return world.entities[track.entity].support not in world.contacts(track.entity)


def _lost(track: Track, view: View) -> Track:
    """Return the track after the object left the fingers."""
    track = replace(track, held=False, loose=0)
    if not track.lifted:
        return track
    old = track.old_place
    return replace(
        track,
        lifted=False,
        lost_step=view.trajectory.step,
        lost_open=not all(
            view.world.robot.closes(step.action) for step in view.trajectory.executed[-_OPENING_STEPS:]
        ),
        lost_m=_away_m(track, view.world, track.at),
        lost_old_m=None if old is None else math.hypot(track.at[0] - old[0], track.at[1] - old[1]),
        lost_at=track.at,
    )


def _after_change(state: State, view: View) -> State:
    """Return the state after changes: what they moved rests elsewhere, and the approach begins anew."""
    world, firings = view.world, view.trajectory.firings
    goal = tuple(track.fact for track in state.tracks)
    tracks = state.tracks
    if goal != (None,) and goal != (new := _goal(cast(PrivilegedWorld, world))):
        known = {track.fact: track for track in tracks}
        tracks = tuple(known.get(fact) or _track(cast(PrivilegedWorld, world), fact) for fact in new)
    for firing in firings[state.firings :]:
        tracks = tuple(_displaced(track, world, firing) for track in tracks)
        placed = positions_of(firing, "after")
        objects = {name: (rest, up) for name, rest, up in state.objects}
        for name in placed.keys() & world.entities.keys() - set(world.parked):
            objects[name] = (placed[name], objects[name][1] if name in objects else rest_of(world, name)[1])
        kept = sorted(name for name in objects if name not in world.parked)
        state = replace(state, objects=tuple((name, *objects[name]) for name in kept))
    return replace(state, tracks=tracks, firings=len(firings))


def _displaced(track: Track, world: World, firing: Firing) -> Track:
    before, after = positions_of(firing, "before"), positions_of(firing, "after")
    old, old_place, rest = track.old, track.old_place, track.rest
    if track.entity in after and not track.part:
        rest = after[track.entity]
        if _far(was := before.get(track.entity, rest), rest):
            old = was
    place = track.fact.place if track.fact else None
    carrier = None if place is None else owner_of(world, place)
    if place is not None and carrier in before.keys() & after and _far(before[carrier], after[carrier]):
        now, shift = _place(world, place), np.subtract(after[carrier], before[carrier])
        old_place = _point(now - shift)
    return replace(
        track,
        rest=rest,
        old=old,
        old_place=old_place,
        closest_m=math.inf,
        close_step=None,
        close_m=None,
        close_old_m=None,
    )


def positions_of(firing: Firing, when: str) -> dict[str, Point]:
    """Return the positions of the objects that a change moved, (3,) m each, ``before`` it or ``after`` it."""
    found = getattr(firing.applied.evidence, when).get("position_m", {})
    return {name: tuple(map(float, at)) for name, at in found.items()} if isinstance(found, Mapping) else {}


def _far(one: Point, other: Point) -> bool:
    return distance_m(np.array(one), np.array(other)) >= MOVED_M


# Every fifth step.


def _sample(state: State, view: View, last: Step) -> State:
    """Return the state after a look at everything."""
    world, step = view.world, view.trajectory.step
    tracks = state.tracks
    if len(tracks) > 1 or any(track.start for track in tracks):
        tracks = tuple(_sampled(track, view, last) for track in tracks)
    subjects = {track.entity for track in tracks}
    known, lifted = {name for name, _ in state.moved}, {name for name, _ in state.wrong}
    moved, wrong = list(state.moved), list(state.wrong)
    for name, rest, _ in state.objects:
        if name in subjects or name in lifted:
            continue
        at = world.position(name)
        off = distance_m(at, np.array(rest))
        if off >= MOVED_M:
            if name not in known:
                moved.append((name, step))
            if (
                at[2] - rest[2] > MOVED_M
                and distance_m(at, last.end_effector) < _NEAR_M
                and world.fingers_on(name) >= 2
            ):
                wrong.append((name, step))
    blocked = state.blocked
    if _is_held_up(view, last):
        first, number, names = blocked
        if number % _LOOK_STEPS == 0:
            names = tuple(sorted({*names, *_touched(world, tracks)}))
        blocked = (step - SAMPLE_STEPS if first is None else first, number + SAMPLE_STEPS, names)
    return replace(state, tracks=tracks, moved=tuple(moved), wrong=tuple(wrong), blocked=blocked)


def _sampled(track: Track, view: View, last: Step) -> Track:
    world, step, fact = view.world, view.trajectory.step, track.fact
    if fact is None:
        return track
    privileged = cast(PrivilegedWorld, world)
    if track.satisfied_step is None and privileged.holds(fact):
        track = replace(track, satisfied_step=step)
    if track.part:
        distance = distance_m(last.end_effector, np.asarray(_part(privileged, fact)))
        if distance < track.closest_m:
            track = replace(track, closest_m=distance, closest_step=step)
        if track.touch_step is None and world.fingers_on(track.entity):
            track = replace(track, touch_step=step)
    ways = [abs(now - then) for now, then in zip(_joints(privileged, fact), track.start, strict=True)]
    travel = max(ways, default=0.0)
    return replace(track, travel=travel) if travel > track.travel else track


def _is_held_up(view: View, last: Step) -> bool:
    """Return True if the hand was told to move during the last five steps, and hardly did."""
    executed = view.trajectory.executed
    if len(executed) <= SAMPLE_STEPS:
        return False
    if distance_m(last.end_effector, executed[-1 - SAMPLE_STEPS].end_effector) >= _HELD_UP_M:
        return False
    if view.control == "absolute":
        return distance_m(last.action[:3], last.end_effector) > _PUSHING_M
    asked = np.mean([step.action[:3] for step in executed[-SAMPLE_STEPS:]], axis=0)
    return float(np.linalg.norm(np.clip(asked, -1.0, 1.0))) > _PUSHING


def _touched(world: World, tracks: Iterable[Track]) -> set[str]:
    """Names of what the robot, or an object that it holds, touches; not the held object."""
    held = {track.entity for track in tracks if track.held}
    names = {
        name
        for name in world.entities
        if name not in world.parked and {ROBOT, GRIPPER} & set(world.contacts(name))
    }
    names |= {name for entity in held for name in world.contacts(entity)}
    return names - held - {ROBOT, GRIPPER}


# The end.


def _row(track: Track, state: State, view: View) -> dict[str, Any]:
    """Return the columns of one fact."""
    world, solved = view.world, view.trajectory.success
    fact = track.fact
    satisfied = solved or (fact is not None and cast(PrivilegedWorld, world).holds(fact))
    first = track.satisfied_step
    away = away_old = tilt = fell = shift = strayed = None
    if not track.part:
        at, up = rest_of(world, track.entity)
        away = _away_m(track, world, at)
        if track.old_place is not None:
            away_old = math.hypot(at[0] - track.old_place[0], at[1] - track.old_place[1])
        start = next((up for name, _, up in state.objects if name == track.entity), None)
        tilt = None if start is None else round(tilt_deg(up, start), 1)
        if track.lost_step is not None:
            fell = _metres(track.lost_at[2] - at[2])
            strayed = _metres(math.hypot(at[0] - track.lost_at[0], at[1] - track.lost_at[1]))
        shift = _metres(distance_m(np.array(at), np.array(track.rest)))
    hinged = fact is not None and bool(track.start) and _is_hinged(cast(PrivilegedWorld, world), fact)
    return {
        "goal": track.entity if fact is None else " ".join(fact.words()),
        "entity": track.entity,
        "satisfied": satisfied,
        "satisfied_step": view.trajectory.step if satisfied and first is None else first,
        "closest_m": _metres(track.closest_m) if math.isfinite(track.closest_m) else None,
        "closest_step": track.closest_step if math.isfinite(track.closest_m) else None,
        **{name: getattr(track, name) for name in ("touch_step", "close_step", "grasp_step", "lift_step")},
        **{name: _metres(getattr(track, name)) for name in ("close_m", "close_old_m", "lift_m", "carried_m")},
        "above_step": track.above_step,
        "lost_step": track.lost_step,
        "lost_open": track.lost_open,
        "lost_m": _metres(track.lost_m),
        "lost_old_m": _metres(track.lost_old_m),
        "fell_m": fell,
        "holding": track.held and track.lifted,
        "away_m": _metres(away),
        "away_old_m": _metres(away_old),
        "strayed_m": strayed,
        "shift_m": shift,
        "tilt_deg": tilt,
        "travel_m": _metres(track.travel) if track.start and not hinged else None,
        "travel_rad": _metres(track.travel) if track.start and hinged else None,
    }


def _still_step(executed: Sequence[Step]) -> int:
    """Policy steps executed when the hand came to where it stayed to the end."""
    still = len(executed)
    for step in reversed(executed):
        if distance_m(step.end_effector, executed[-1].end_effector) > STILL_M:
            break
        still -= 1
    return still


def _repeated(view: View) -> int:
    """Return the number of answers at the end that equal the one before, to the last bit."""
    queries = view.trajectory.queries
    number = 0
    for later, earlier in zip(reversed(queries), reversed(queries[:-1]), strict=False):
        if later.actions.tobytes() != earlier.actions.tobytes():
            break
        number += 1
    return number


def rest_of(world: World, name: str) -> tuple[Point, Point]:
    """Return the position of an object, (3,) m, and what of it points up: the vertical in its frame."""
    at, (w, x, y, z) = world.pose(name)
    return _point(at), (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))


def rests_of(world: World) -> tuple[tuple[str, Point, Point], ...]:
    """Return every object that is in the scene, sorted by name, with its :func:`rest_of`."""
    return tuple(
        (name, *rest_of(world, name))
        for name, entity in sorted(world.entities.items())  # LIBERO has them in another order each time
        if entity.kind == "object" and name not in world.parked
    )


def tilt_deg(up: Point, start: Point) -> float:
    """Return the angle between what points up of an object and what pointed up at the start, degrees."""
    cosine = sum(one * other for one, other in zip(up, start, strict=True))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def _point(values: Array) -> Point:
    return tuple(map(float, values.tolist()))


def _metres(value: float | None) -> float | None:
    """Return a length to a tenth of a millimetre, which keeps records short."""
    return None if value is None else round(value, 4)
