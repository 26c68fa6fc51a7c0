"""What holds for every schedule, drawn from the public strategies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case, Event
from pytest_libero_max.benchmark.programs import parse_program
from pytest_libero_max.changes import Change, change_from_dict
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of
from pytest_libero_max.events.triggers import AtStart, Proximity, StepsAfter, Trigger
from pytest_libero_max.pairing.probes.registry import PROBES, probes_called
from pytest_libero_max.pairing.rollout import Rollout
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.stage import Stage
from pytest_libero_max.pairing.trajectory import Trajectory
from pytest_libero_max.substrates.tiny.world import TinyWorld
from tests.changes.world_comparison import play, pose_bytes, set_up, velocity_slices

from .actors import Approaching, make_case, shorten

WORLD = TinyWorld()
LOOKS = ("set_lighting", "shift_camera", "set_visual_theme", "set_sensor_corruption")
TRIGGERS = st.sampled_from([AtStart(), Proximity("box_1", 0.25), Proximity("box_1", 0.4)])
FEW = settings(max_examples=6)


def looks() -> st.SearchStrategy[Change]:
    found = strategies.changes(WORLD.entities, operations=LOOKS)
    return found.filter(lambda change: change.to_dict().get("scale") != 1.0)


def ends(*arms: Arm, case: Case | None = None, **options: Any) -> dict[str, Trajectory]:
    """Play the arms; a policy that moves the hand to the box, and everything that happened, by arm."""
    policy = Approaching(wait=2, horizon=5, interval=4)
    pair = measure_pair(case or make_case(), WORLD, policy, PairSettings(**options), arms=arms)
    return {name: rollout.trajectory for name, rollout in pair.rollouts.items()}


def velocity_bytes(world: TinyWorld, name: str) -> bytes:
    return (
        bytes(world.data.qvel[velocity_slices(world)[name]].tobytes())
        if name in velocity_slices(world)
        else b""
    )


def poses(trajectory: Trajectory) -> tuple[bytes, bytes]:
    return np.array(trajectory.end_effector).tobytes(), np.array(trajectory.entity).tobytes()


@given(looks(), TRIGGERS, st.integers(1, 12))
@FEW
def test_what_is_only_seen_for_a_while_leaves_the_world_bit_for_bit(
    change: Change, trigger: Trigger, steps: int
) -> None:
    flash = (Entry(trigger, change), Entry(StepsAfter(steps), Revert(0)))
    try:
        played = ends(Arm("base"), Arm("dynamic", flash))
    except Exception as error:
        assert "bit for bit" in str(error), error  # noqa: PT017
        return
    base, dynamic = played["base"], played["dynamic"]
    there, back = dynamic.firings
    assert back.step == there.step + steps
    assert (dynamic.step, dynamic.digest) == (base.step, base.digest)
    assert poses(dynamic) == poses(base)


INSERTIONS = ("distractor_burst", "obstacle_insertion")
MOVES = ("target_relocation", "receptacle_relocation")


@given(strategies.events(WORLD.entities, names=(*INSERTIONS, *MOVES)), TRIGGERS, st.integers(1, 12))
@FEW
def test_what_is_there_or_elsewhere_for_a_while_comes_back_bit_for_bit(
    event: Event, trigger: Trigger, steps: int
) -> None:
    """Of the world, all but what physics has done meanwhile; of what was inserted, that as well.

    Things that have been pushed away stay so, and one that moved comes back to rest, where it was.
    """
    case, change = shorten(replace(make_case(), event=event)), change_from_dict(event.change)
    moved = sorted(factor.removeprefix("pose:") for factor in change.factors)
    schedule = (Entry(trigger, change), Entry(StepsAfter(steps), Revert(0)))
    states, bodies, ended = [], [], []
    for arm in (Arm("base"), Arm("dynamic", schedule)):
        stage = Stage(case, WORLD, Approaching(wait=2, horizon=5, interval=4))
        ended.append(Rollout.start(stage, (arm,)).advance_to_end())
        states.append(WORLD.snapshot())
        bodies.append(
            [(pose_bytes(WORLD, one), velocity_bytes(WORLD, one), one in WORLD.parked) for one in moved]
        )
    if len(ended[1].firings) < 2:
        return
    there, back = (firing.applied.evidence for firing in ended[1].firings)
    assert back.after == {name: there.before[name] for name in back.after}
    base, dynamic = states
    assert set(base.differing(dynamic)) <= {"physics"}
    if event.name in INSERTIONS:
        assert bodies[0] == bodies[1]


@given(
    strategies.events(WORLD.entities, names=(*INSERTIONS, *MOVES)), strategies.action_sequences(max_size=6)
)
@FEW
def test_undone_at_once_an_insertion_leaves_nothing_and_a_move_an_object_at_rest(
    event: Event, steps: list[tuple[float, ...]]
) -> None:
    WORLD.reset(0)
    change = set_up(WORLD, event)
    play(WORLD, steps)
    before = WORLD.snapshot()
    change.reverted(change.apply(WORLD)).apply(WORLD)
    undone = WORLD.digest()
    WORLD.restore(before)
    for name in (factor.removeprefix("pose:") for factor in change.factors):
        if name not in WORLD.parked:
            WORLD.place(name, WORLD.position(name))
    assert WORLD.digest() == undone
    if event.name in INSERTIONS:
        WORLD.restore(before)
        assert WORLD.digest() == undone


@given(strategies.events(WORLD.entities, distances_m=st.just(0.3)))
@FEW
def test_a_schedule_of_one_entry_is_the_event(event: Event) -> None:
    case = shorten(replace(make_case(), event=event))
    entry = {"trigger": event.trigger, "change": event.change}
    program = parse_program({"name": "spelled", "arms": [{"name": "dynamic", "schedule": [entry]}]})
    spelled = replace(case, program=program)
    one, other = (ends(*arms_of(of), case=case) for of in (case, spelled))
    assert {name: arm.proof for name, arm in one.items()} == {name: arm.proof for name, arm in other.items()}


@given(
    st.tuples(*[strategies.changes(WORLD.entities, operations=("move_object", *LOOKS))] * 2).filter(
        lambda pair: not pair[0].factors & pair[1].factors
    ),
    TRIGGERS,
    st.integers(0, 5),
)
@FEW
def test_schedules_commute_where_their_factors_are_disjoint(
    changes: tuple[Change, Change], trigger: Trigger, between: int
) -> None:
    """Two changes at one moment, in either order; or the one undone before or after the other happens."""
    one, other = changes
    orders: list[tuple[Entry, ...]] = [
        (Entry(trigger, one), Entry(trigger, other)),
        (Entry(trigger, other), Entry(trigger, one)),
    ]
    if between:
        undone = Entry(StepsAfter(between, entry=0), Revert(0))
        late = Entry(StepsAfter(between, entry=0), other)
        orders = [(Entry(trigger, one), undone, late), (Entry(trigger, one), late, undone)]
    try:
        first, second = (ends(Arm("base"), Arm("dynamic", order))["dynamic"] for order in orders)
    except Exception as error:
        assert "bit for bit" in str(error), error  # noqa: PT017
        return
    assert (first.step, first.digest) == (second.step, second.digest)
    assert poses(first) == poses(second)


@given(strategies.events(WORLD.entities, names=INSERTIONS), looks(), TRIGGERS, st.integers(1, 6))
@FEW
def test_what_is_inserted_for_a_while_commutes_with_what_is_only_seen(
    event: Event, look: Change, trigger: Trigger, steps: int
) -> None:
    case, change = shorten(replace(make_case(), event=event)), change_from_dict(event.change)
    orders = [(change, look, 0), (look, change, 1)]
    try:
        first, second = (
            ends(
                Arm("base"),
                Arm(
                    "dynamic",
                    (Entry(trigger, one), Entry(trigger, two), Entry(StepsAfter(steps), Revert(inserted))),
                ),
                case=case,
            )["dynamic"]
            for one, two, inserted in orders
        )
    except Exception as error:
        assert "bit for bit" in str(error), error  # noqa: PT017
        return
    assert (first.step, first.digest) == (second.step, second.digest)
    assert poses(first) == poses(second)


@given(
    st.sets(st.sampled_from(sorted(PROBES))),
    strategies.events(WORLD.entities, distances_m=st.just(0.3)),
    st.sampled_from(["fork", "replay"]),
)
@FEW
def test_probes_never_change_a_proof(names: set[str], event: Event, prefix: str) -> None:
    case = shorten(replace(make_case(), event=event))
    arms, probes = arms_of(case), probes_called(sorted(names))
    plain, probed = (ends(*arms, case=case, prefix=prefix, **options) for options in ({}, {"probes": probes}))
    assert {name: arm.proof for name, arm in plain.items()} == {
        name: arm.proof for name, arm in probed.items()
    }
