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
from pytest_libero_max.changes import Change
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of
from pytest_libero_max.events.triggers import AtStart, Proximity, StepsAfter, Trigger
from pytest_libero_max.pairing.probes.registry import PROBES, probes_called
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.trajectory import Trajectory
from pytest_libero_max.substrates.tiny.world import TinyWorld

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
        assert "left the world bit for bit as it was" in str(error), error  # noqa: PT017
        return
    base, dynamic = played["base"], played["dynamic"]
    there, back = dynamic.firings
    assert back.step == there.step + steps
    assert (dynamic.step, dynamic.digest) == (base.step, base.digest)
    assert poses(dynamic) == poses(base)


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
    st.tuples(looks(), strategies.changes(WORLD.entities, operations=("move_object", *LOOKS))).filter(
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
        assert "left the world bit for bit as it was" in str(error), error  # noqa: PT017
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
