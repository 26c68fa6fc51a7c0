"""Rules for events: each alters its factors and nothing else, and can be taken back."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from pytest_libero_max.changes.change import Change, Evidence
from pytest_libero_max.conformance.rules import Finding, Rule, broken, kept, unexamined
from pytest_libero_max.conformance.substrate.states import RESTORE, play
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject, actions_for
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.events.registry import BENCHMARK_EVENTS
from pytest_libero_max.events.schedules import change_of
from pytest_libero_max.worlds.contract import World, WorldState, alterable

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
