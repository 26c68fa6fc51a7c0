"""Rules for states, which a reset and a snapshot bring back bit for bit, for their images and for events."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from pytest_libero_max.changes.change import Change, Evidence
from pytest_libero_max.conformance.fresh_process import result_elsewhere
from pytest_libero_max.conformance.rules import Finding, Rule, broken, kept, rule, unexamined
from pytest_libero_max.conformance.substrate.contract import OPENS
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject, actions_for, open_subject
from pytest_libero_max.errors import ChangeError, counted
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.events.schedules import change_of
from pytest_libero_max.worlds.contract import AlterableWorld, Array, OnMujoco, World, WorldState, alterable

_STATE = ("qpos", "qvel", "act", "qacc_warmstart", "ctrl", "qfrc_applied", "xfrc_applied", "mocap_pos")
"""Arrays of MuJoCo's state, of each of which some elements are written to."""

COPIES = "substrate/states/aliases"
RESTORE = "substrate/states/restore"

FRESH_S = 600.0
"""Longest time of the fresh process, s: it builds one world."""


def play(world: World, first: int = 0) -> list[str]:
    """Play the actions from ``first`` on, and return the digest after each step."""
    digests = []
    for action in actions_for(world)[first:]:
        world.step(action)
        digests.append(world.digest().hex())
    return digests


def beginning(subject: SubstrateSubject) -> dict[str, object]:
    """Return what a process must find again of the first world: poses, digests, and content of the scene."""
    world = subject.begin()
    poses = {name: np.concatenate(world.pose(name)).tolist() for name in sorted(world.entities)}
    return {
        "poses": poses,
        "fields": dict(world.scene_fields()),
        "digests": [world.digest().hex(), *play(world)],
    }


def beginning_of(name: str) -> dict[str, object]:
    """Return the beginning of the substrate of a name."""
    return beginning(open_subject(name))


@rule("substrate/states/steps", "must", needs=OPENS)
def same_steps(subject: SubstrateSubject) -> Finding:
    """Arrive at the same bits from the same initial state with the same actions."""
    first, second = (play(subject.begin()) for _ in range(2))
    if first == second:
        return kept(f"{len(first)} steps, played twice, have the same digests")
    step = next(index for index, pair in enumerate(zip(first, second, strict=True)) if pair[0] != pair[1])
    return broken(
        f"the second time, step {step} has another digest",
        "equal digests",
        "Something of the simulator outlives a reset: warm starts, controllers, random numbers.",
    )


@rule("substrate/states/index", "must", needs=OPENS)
def by_index(subject: SubstrateSubject) -> Finding:
    """Choose the initial state by its index, not by the number of resets."""
    world = subject.world
    digests = []
    for init in (0, 1, 0, 0):
        world.reset(init)
        digests.append(world.digest())
    if digests[0] == digests[2] == digests[3]:
        differ = "differ" if digests[0] != digests[1] else "are equal"
        return kept(f"reset(0) is the same after other resets; initial states 0 and 1 {differ}")
    return broken(
        "reset(0) begins elsewhere after other resets",
        "the same bits",
        "Take initial state `init` of the list, not the next one, and draw nothing.",
    )


@rule("substrate/states/process", "must", needs="substrate/states/steps")
def fresh_process(subject: SubstrateSubject) -> Finding:
    """Build the same scene, with every thing in the same place, in another process."""
    if not subject.name:
        return unexamined("the substrate is an object of this process")
    here = beginning(subject)
    there = result_elsewhere(
        beginning_of,
        subject.name,
        FRESH_S,
        expected="the same scene",
        cure="The substrate needs something of this process or its home.",
    )
    return there if isinstance(there, Finding) else _compared(json.loads(json.dumps(here)), there)


def _compared(here: Any, there: Any) -> Finding:
    moved = [name for name, pose in here["poses"].items() if there["poses"].get(name) != pose]
    fields = [name for name, digest in here["fields"].items() if there["fields"].get(name) != digest]
    if not moved and not fields and here["digests"] == there["digests"]:
        return kept("another process has the same scene, and the same digests after each step")
    if moved:
        observed = f"in another process {', '.join(moved)} stand elsewhere"
    elif fields:
        observed = f"in another process the scene differs in {', '.join(fields)}"
    else:
        observed = "in another process the digests of the steps differ"
    return broken(
        observed,
        "the same scene, bit for bit",
        "A set, a hash, a listing of a folder or a random number decides what is built.",
    )


@rule(COPIES, "must", needs=OPENS)
def snapshot_is_a_copy(subject: SubstrateSubject) -> Finding:
    """Copy the state into a snapshot, so that the live world does not alter it."""
    world = subject.begin()
    state = world.snapshot()
    arrays = (state.physics, state.controller, *state.model.values())
    before = [array.tobytes() for array in arrays]
    play(world)
    if before == [array.tobytes() for array in arrays]:
        return kept("a snapshot stays as it was while the world goes on")
    return broken("a snapshot changed while the world went on", "a copy", "Copy the arrays.")


@rule(RESTORE, "must", needs=COPIES)
def restore(subject: SubstrateSubject) -> Finding:
    """Return to a snapshot bit for bit, and go on as if nothing had been in between."""
    world = subject.begin()
    for action in actions_for(world)[:10]:
        world.step(action)
    state, digest = world.snapshot(), world.digest()
    onward = play(world, 10)
    world.restore(state)
    if world.digest() != digest:
        return broken("restore() arrives at another digest", "that of the snapshot", "Restore everything.")
    if play(world, 10) != onward:
        return broken(
            "after restore() the same actions lead elsewhere",
            "the digests of the first time (fork equals replay)",
            "The snapshot lacks something that the future depends on: warm starts, controllers, filters, "
            "the environment's own fields.",
        )
    return kept(f"after restore(), {len(onward)} steps have the same digests")


@rule("substrate/states/complete", "must", needs=RESTORE)
def complete(subject: SubstrateSubject) -> Finding:
    """Cover by the digest, and bring back with restore(), everything of the simulator's state."""
    world = subject.begin()
    if not isinstance(world, OnMujoco):
        return unexamined("the world has no state of MuJoCo to write to")
    play(world)
    state, digest = world.snapshot(), world.digest()
    missed, left = [], []
    for name in _STATE:
        array = getattr(world.data, name)
        for place in range(0, array.size, max(1, array.size // 8)):
            array.flat[place] += 1e-9 + abs(array.flat[place]) * 1e-9
            if world.digest() == digest:
                missed.append(f"{name}[{place}]")
            world.restore(state)
            if world.digest() != digest:
                left.append(f"{name}[{place}]")
    if missed or left:
        parts = [f"the digest does not cover {', '.join(missed)}"] * bool(missed)
        parts += [f"restore() leaves {', '.join(left)}"] * bool(left)
        return broken(
            " and ".join(parts),
            "a digest and a snapshot of the whole integration state",
            "Take mjSTATE_INTEGRATION, not qpos and qvel.",
        )
    return kept("writes to MuJoCo's state change the digest, and restore() takes them back")


@rule("substrate/states/writes", "must", needs=RESTORE)
def takes_back_writes(subject: SubstrateSubject) -> Finding:
    """Notice and undo what was written to the model from outside."""
    world = subject.begin()
    if not isinstance(world, OnMujoco):
        return unexamined("the world has no model of MuJoCo to write to")
    world.take_back_writes()
    mass, gravity = world.model.body_mass.copy(), np.array(world.model.opt.gravity)
    world.model.body_mass[-1] += 1.0  # the last body may have none
    world.model.opt.gravity[2] = -1.0
    named = world.take_back_writes()
    world = subject.begin()
    assert isinstance(world, OnMujoco)
    undone = np.array_equal(world.model.body_mass, mass) and np.array_equal(world.model.opt.gravity, gravity)
    if {"body_mass", "opt.gravity"} <= {*named} and undone:
        return kept("writes to fixed fields of the model are named and undone")
    return broken(
        f"of body_mass and opt.gravity, take_back_writes() names {', '.join(named) or 'none'}"
        f"{'' if undone else ', and they stay'}",
        "both, undone",
        "A policy that writes to the model plays in another world than its neighbours.",
    )


@rule("substrate/states/success", "must", needs=OPENS)
def not_yet_done(subject: SubstrateSubject) -> Finding:
    """Hold the goal for not reached at the beginning of an episode."""
    one_a_suite = {case.suite: case for case in reversed(subject.cases or (subject.case,))}
    for case in one_a_suite.values():
        if subject.begin(case).succeeded():
            return broken(
                f"{case.case_id}: the goal holds at the beginning",
                "a goal that is still to be reached",
                "The goal's predicates, or the initial states, are those of another task.",
            )
    return kept("no goal holds at the beginning of an episode")


KEYS = "substrate/images/keys"

_SIDE = 128
Points = list[tuple[float, float]]


@rule(KEYS, "must", needs=OPENS)
def keys(subject: SubstrateSubject) -> Finding:
    """Observe the keys of the robot, LIBERO's for its Panda, each in its shape."""
    world = subject.begin()
    robot = world.robot
    observation = world.observe(robot.cameras, (96, _SIDE))
    shapes: dict[str, tuple[int, ...]] = {key: (size,) for key, size in robot.state.items()}
    shapes |= {f"{camera}_image": (96, _SIDE, 3) for camera in robot.cameras}
    wrong = [
        f"{key} {observation[key].shape if key in observation else 'missing'}"
        for key, shape in shapes.items()
        if key not in observation or observation[key].shape != shape
    ]
    wrong += [
        f"{camera}_image of {observation[f'{camera}_image'].dtype}"
        for camera in robot.cameras
        if f"{camera}_image" in observation and observation[f"{camera}_image"].dtype != np.uint8
    ]
    if wrong:
        return broken(
            ", ".join(wrong),
            f"the keys and shapes of robot {robot.name!r}, images (H, W, 3) uint8",
            "Rename and reshape.",
        )
    return kept(f"{len(shapes)} keys in their shapes")


@rule("substrate/images/same", "must", needs=KEYS)
def same_images(subject: SubstrateSubject) -> Finding:
    """Draw the same pixels in the same state: twice, and after steps that restore() took back."""
    world = subject.begin()
    first = world.observe(world.robot.cameras, _SIDE)
    repeated = world.observe(world.robot.cameras, _SIDE)
    state = world.snapshot()
    for action in actions_for(world):
        world.step(action)
    moved = world.observe(world.robot.cameras, _SIDE)
    world.restore(state)
    after = world.observe(world.robot.cameras, _SIDE)
    for camera in world.robot.cameras:
        key = f"{camera}_image"
        for what, later in (("drawn twice", repeated), ("drawn after restore()", after)):
            if not np.array_equal(first[key], later[key]):
                return broken(
                    f"{key} {what} differs in {int((first[key] != later[key]).any(axis=2).sum())} pixels",
                    "the same pixels",
                    "Something that is drawn is not part of the state.",
                )
        if np.array_equal(first[key], moved[key]):
            return broken(
                f"{key} is the same after {counted(len(actions_for(world)), 'step')}",
                "another image",
                "An old image is returned, or what moves is not drawn: MuJoCo's geoms of groups 1 and 2 are.",
            )
    return kept("the same state has the same pixels, another one has others")


@rule("substrate/images/physics", "must", needs=KEYS)
def drawing_alters_nothing(subject: SubstrateSubject) -> Finding:
    """Leave the state as it is when images are drawn."""
    world = subject.begin()
    before = world.digest()
    world.observe(world.robot.cameras, _SIDE)
    if world.digest() == before:
        return kept("drawing alters nothing")
    return broken("the digest changed when images were drawn", "the same digest", "Draw from a copy.")


@rule("substrate/images/rows", "must", needs=RESTORE)
def row_order(subject: SubstrateSubject) -> Finding:
    """Deliver images bottom row first, not mirrored, as LIBERO does."""
    from pytest_libero_max.worlds.rendering.appearance import pose_of_camera

    world = subject.begin()
    if not isinstance(world, AlterableWorld):
        return unexamined("the pose of the camera is known of worlds that changes can alter alone")
    camera = world.robot.cameras[0]
    places, images = [], []
    for axis, sign in ((1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)):
        world = subject.begin()
        action = np.array(world.robot.noop)
        action[axis] = sign
        for _ in range(4):
            world.step(action)
        position, turn, fovy_rad = pose_of_camera(alterable(world), camera)
        x, y, z = (np.asarray(world.end_effector()) - position) @ turn
        focal = 0.5 * _SIDE / np.tan(0.5 * fovy_rad)
        place = (_SIDE / 2 - focal * y / z, _SIDE / 2 - focal * x / z)
        if z < 0.0 and min(place) > 0.0 and max(place) < _SIDE:
            places.append(place)
            images.append(world.observe([camera], _SIDE)[f"{camera}_image"].astype(float))
    if len(places) < 3:
        return unexamined("the hand leaves the view of the main camera within four steps")
    hands = [_what_only_this_shows(images, number) for number in range(len(images))]
    turns = {
        "bottom row first": (1, 1),
        "top row first": (-1, 1),
        "bottom row first and mirrored": (1, -1),
        "top row first and mirrored": (-1, -1),
    }
    likeness = {name: _likeness(hands, places, turn) for name, turn in turns.items()}
    best = max(likeness, key=lambda name: likeness[name])
    if best == "bottom row first":
        return kept("images come bottom row first, as OpenGL delivers them")
    return broken(
        f"images come {best}",
        "bottom row first, so that image[::-1] is upright",
        "Policies rotate images by 180 degrees: an image that is upright already arrives upside down.",
    )


def _what_only_this_shows(images: list[Array], number: int) -> tuple[float, float]:
    """Return the row and the column around which an image differs from each of the others: the hand."""
    others = [image for index, image in enumerate(images) if index != number]
    weights = np.min([np.abs(images[number] - image).sum(axis=2) for image in others], axis=0)
    rows, columns = np.indices(weights.shape)
    total = max(float(weights.sum()), 1e-9)
    return float((rows * weights).sum()) / total, float((columns * weights).sum()) / total


def _likeness(hands: Points, places: Points, turn: tuple[int, int]) -> float:
    """Return how well the movements of the hand from image to image fit those of its places, if turned."""
    seen, meant = (np.array(points) - np.mean(points, axis=0) for points in (hands, places))
    return float((seen * meant * turn).sum())


_SEEN_ONLY = frozenset({"camera", "light", "material", "pixels", "state", "instruction"})
"""Kinds of factors that leave every body where it is."""


def _poses(world: World) -> dict[str, bytes]:
    return {name: np.concatenate(world.pose(name)).tobytes() for name in world.entities}


def _examine(event: str, subject: SubstrateSubject) -> Iterator[Finding]:
    case = subject.case_of(event)
    if case is None:
        yield unexamined("no case of the default track that can be played here has this event")
        return
    world = subject.begin(case)
    for action in actions_for(world)[:5]:
        world.step(action)
    change = change_of(case)
    before, poses = world.snapshot(), _poses(world)
    play(world, 10)
    future = world.snapshot().physics.tobytes()
    world.restore(before)
    evidence = change.apply(alterable(world))
    differing = world.snapshot().differing(before)
    if not differing:
        yield broken("the world stays bit for bit as it was", "another world", "The change writes nowhere.")
        return
    may_move = {factor.partition(":")[2] for factor in change.factors if factor.startswith("pose:")}
    moved = {name for name, pose in _poses(world).items() if pose != poses[name]}
    if moved - may_move:
        yield broken(
            f"{', '.join(sorted(moved - may_move))} moved as well",
            f"nothing but {', '.join(sorted(change.factors))}",
            "Write to the places of the factors alone.",
        )
        return
    seen_only = {factor.partition(":")[0] for factor in change.factors} <= _SEEN_ONLY
    changed = world.snapshot()
    play(world, 10)
    if seen_only and world.snapshot().physics.tobytes() != future:
        yield broken(
            f"after {', '.join(differing)} changed, the same actions lead elsewhere",
            "the same positions and velocities",
            "An event that is only seen must leave the physical future as it was.",
        )
        return
    world.restore(changed)
    yield kept(f"{case.case_id}: {', '.join(differing)} changed")
    yield _taken_back(world, change, evidence, before, poses)


def _taken_back(
    world: World, change: Change, evidence: Evidence, before: WorldState, poses: dict[str, bytes]
) -> Finding:
    try:
        change.reverted(evidence).apply(alterable(world))
    except ChangeError as error:
        return kept(f"it cannot be taken back, and says so: {error}")
    # What is computed from the state, and how an object that is out of the scene turns there, is not what the
    # change wrote.
    left = [name for name in world.snapshot().differing(before) if name not in ("physics", "controller")]
    left += [name for name, pose in _poses(world).items() if pose != poses[name] and name not in world.parked]
    if left:
        return broken(
            f"taken back, {', '.join(left)} are not as before",
            "the former values, bit for bit",
            "Keep the former values in the evidence.",
        )
    return kept("it can be taken back")


def _rule(event: str) -> Rule:
    check = partial(_examine, event)
    check.__doc__ = f"Let {event} alter its factors and nothing else."
    return Rule(f"substrate/events/{event}", "must", check, RESTORE)


EVENT_RULES = tuple(map(_rule, BENCHMARK_EVENTS))
