"""Rules for states: a reset starts over, a snapshot holds everything, and both arrive at the same bits."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pytest_libero_max.conformance.fresh_process import result_elsewhere
from pytest_libero_max.conformance.rules import Finding, broken, kept, rule, unexamined
from pytest_libero_max.conformance.substrate.contract import OPENS
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject, actions_for, open_subject
from pytest_libero_max.worlds.contract import OnMujoco, World

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
