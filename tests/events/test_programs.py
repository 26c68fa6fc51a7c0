"""Programs become arms and arms become programs; one without a meaning is refused before a pair is played."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pytest_libero_max import strategies
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.programs import find_program, parse_program, program_names
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.changes import (
    BumpObject,
    MoveObject,
    SetInstruction,
    SetTask,
    ShiftCamera,
    change_from_dict,
)
from pytest_libero_max.errors import ManifestError
from pytest_libero_max.events.registry import check_cases
from pytest_libero_max.events.schedules import (
    Arm,
    Cadence,
    Entry,
    Revert,
    arms_of,
    change_of,
    program_of,
    trigger_of,
)
from pytest_libero_max.events.triggers import (
    Above,
    AfterGrasp,
    AtStart,
    BudgetFraction,
    Proximity,
    StepsAfter,
    Trigger,
)
from pytest_libero_max.substrates.embedded.catalogue.lookup import variation_of
from pytest_libero_max.substrates.variation import variation_metadata
from tests.pairing.actors import make_case

FLAGS: st.SearchStrategy[bool] = st.booleans()
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,7}", fullmatch=True)
LENGTHS = st.floats(0.01, 2.0)
TRIGGERS: st.SearchStrategy[Trigger] = st.one_of(
    st.builds(Proximity, NAMES, LENGTHS),
    st.builds(AtStart),
    st.builds(AfterGrasp, NAMES),
    st.builds(Above, NAMES, LENGTHS),
    st.builds(BudgetFraction, st.floats(0.01, 0.99)),
)
CHANGES = st.one_of(
    strategies.events().map(lambda event: change_from_dict(event.change)),
    st.builds(SetInstruction, NAMES),
    st.builds(SetTask, NAMES, st.just((("on", "box_1", "plate_1"),))),
)


@st.composite
def schedules(draw: st.DrawFn, least: int = 0) -> tuple[Entry, ...]:
    """Changes, reversals of some of them, and every trigger."""
    schedule: list[Entry] = []
    standing: list[int] = []
    for index in range(draw(st.integers(least, 4))):
        after = (
            st.builds(StepsAfter, st.integers(1, 30), st.integers(-1, index - 1)) if index else st.nothing()
        )
        trigger = draw(TRIGGERS | after)
        takes_back = draw(FLAGS)
        if standing and takes_back:
            place = draw(st.sampled_from(standing))
            standing.remove(place)
            schedule.append(Entry(trigger, Revert(place)))
        else:
            standing.append(index)
            schedule.append(Entry(trigger, draw(CHANGES)))
    return tuple(schedule)


CADENCES = st.none() | st.builds(
    lambda interval, more: Cadence(interval, None if more is None else interval + more),
    st.integers(1, 8),
    st.none() | st.integers(0, 8),
)
OTHERS = st.lists(
    st.builds(Arm, NAMES.map("arm_{}".format), schedules(), st.integers(0, 2), CADENCES),
    max_size=3,
    unique_by=lambda arm: arm.name,
)


@settings(max_examples=15)  # an example holds up to sixteen entries
@given(NAMES, schedules(least=1), OTHERS)
def test_arms_survive_being_written_as_a_program(
    name: str, dynamic: tuple[Entry, ...], others: list[Arm]
) -> None:
    arms = (Arm("base"), Arm("dynamic", dynamic), *others)
    program = program_of(name, arms)
    read = parse_program(json.loads(json.dumps(program.to_dict())))
    assert (read, read.digest) == (program, program.digest)
    assert arms_of(make_case(program=read)) == arms


@settings(max_examples=25)
@given(schedules(least=1), st.data())
def test_a_program_with_a_damaged_value_is_an_error_with_words(
    schedule: tuple[Entry, ...], data: st.DataObject
) -> None:
    document = program_of("damaged", (Arm("base"), Arm("dynamic", schedule))).to_dict()
    entry = data.draw(st.sampled_from(document["arms"][1]["schedule"]))
    part = data.draw(st.sampled_from([part for part in entry.values() if isinstance(part, dict)]))
    part[data.draw(st.sampled_from(sorted(part)))] = data.draw(st.sampled_from([None, -1, "", [], {}, 1e400]))
    try:
        arms_of(make_case(program=parse_program(document)))
    except Exception as error:
        assert type(error).__module__ == "pytest_libero_max.errors", error  # noqa: PT017


@pytest.mark.parametrize("track", ["smoke", "original"])
def test_a_case_of_the_authors_is_the_program_of_one_entry(track: str) -> None:
    for case in load_track(track):
        event = Entry(trigger_of(case), change_of(case))
        assert arms_of(case) == (Arm("base"), Arm("dynamic", (event,)))
        spelled = {
            "name": "event",
            "arms": [{"name": "dynamic", "schedule": [{"trigger": "event", "change": "event"}]}],
        }
        assert arms_of(case.playing(parse_program(spelled))) == arms_of(case)


def laid(*schedule: dict[str, Any], name: str = "third") -> Case:
    """A case whose third arm has a schedule."""
    program = {"name": "tried", "arms": [{"name": name, "schedule": list(schedule)}]}
    case = make_case("target_relocation")
    assert isinstance(case.event.change, dict)
    return replace(case, program=parse_program(program))


def test_a_template_refers_to_the_event_of_each_case() -> None:
    case = laid(
        {"trigger": {"type": "after_grasp", "value": {"event": "value"}}, "change": "event", "strength": 0.5},
        {
            "trigger": {"type": "steps_after", "steps": 3},
            "change": {
                "operation": "move_object",
                "object": {"event": "object"},
                "delta_position_m": [0.01, 0, 0],
            },
        },
        {"trigger": {"type": "steps_after", "steps": 3, "entry": 0}, "reverts": 0},
    )
    base, dynamic, third = arms_of(case)
    assert (base, dynamic) == arms_of(replace(case, program=None))
    assert third.schedule == (
        Entry(AfterGrasp("box_1"), change_of(case, 0.5)),
        Entry(StepsAfter(3), MoveObject("box_1", (0.01, 0, 0))),
        Entry(StepsAfter(3, entry=0), Revert(0)),
    )


def test_base_and_dynamic_come_first_and_the_noise_floor_last() -> None:
    assert [arm.name for arm in arms_of(laid(), repeat_base=True)] == [
        "base",
        "dynamic",
        "third",
        "base_again",
    ]


def test_a_share_of_a_program_is_that_of_each_change() -> None:
    case = laid({"trigger": "event", "change": "event", "strength": 0.5})
    _, dynamic, third = arms_of(case, strength=0.5)
    assert dynamic.schedule[0].action == change_of(case, 0.5)
    assert third.schedule[0].action == change_of(case, 0.25)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            {"trigger": {"type": "after_grsp", "value": "box_1"}, "change": "event"},
            r"arms\[0\]\.schedule\[0\]\.trigger\.type='after_grsp' .*'after_",
        ),
        (
            {"trigger": {"type": "after_grasp", "value": 3}, "change": "event"},
            r"schedule\[0\]\.trigger: after_grasp\.value=3,",
        ),
        (
            {"trigger": {"type": "steps_after", "steps": 3, "entry": 4}, "change": "event"},
            r"arms\[0\]: arm 'third', entry 0: .*earlier entry",
        ),
        ({"trigger": "event", "reverts": 0}, "earlier entry"),
        (
            {"trigger": {"type": "after_grasp", "value": {"event": "entity"}}, "change": "event"},
            r"trigger\.value={'event': 'entity'}, .*: "
            "delta_position_m, distance_m, object, operation, type, value",
        ),
        (
            {"trigger": "event", "change": {"operation": "move_objct"}},
            r"schedule\[0\]\.change: operation='move_objct' ",
        ),
        (
            {
                "trigger": "event",
                "change": {"operation": "set_instruction", "instruction": "x"},
                "strength": 0.5,
            },
            r"schedule\[0\]\.change: strength=0.5, but set_instruction ",
        ),
    ],
)
def test_what_cannot_be_built_is_found_before_anything_is_played(entry: dict[str, Any], message: str) -> None:
    with pytest.raises(ManifestError, match=f"^case 'case-target_relocation': .*{message}"):
        check_cases([laid(entry)])


def test_a_trigger_of_the_event_is_checked_as_well() -> None:
    case = make_case()
    wrong = replace(
        case, event=replace(case.event, trigger={"type": "above", "value": "plate_1", "radius_m": 0})
    )
    with pytest.raises(ManifestError, match=r"scenario\.trigger: above\.radius_m=0,"):
        check_cases([wrong])


def test_something_happens_in_dynamic() -> None:
    with pytest.raises(ManifestError, match="in Dynamic"):
        program_of("still", (Arm("base"), Arm("dynamic")))
    with pytest.raises(ManifestError, match="'base'"):
        program_of("twice", (Arm("base"), Arm("base")))
    entry = Entry(AtStart(), ShiftCamera("agentview", (0.1, 0.0, 0.0), 5.0, 0.0))
    assert program_of("reset", (Arm("reset", (entry,)),)).arms[0]["name"] == "reset"


@pytest.mark.parametrize("name", program_names())
def test_a_program_of_the_package_can_be_built_in_every_kind_of_case_that_it_fits(name: str) -> None:
    kinds = {(case.event.name, case.event.variant, case.suite): case for case in load_track("lite")}
    program = find_program(name)
    fitting = [case.playing(program) for case in kinds.values() if case.fits(program)]
    check_cases(fitting)
    assert {entry.action for case in fitting for entry in arms_of(case)[1].schedule}


@pytest.mark.parametrize("name", ["bump", "instruction_switch", "later", "slip"])
def test_the_scene_of_a_case_has_what_a_program_of_the_package_names(name: str) -> None:
    """Objects that are lifted are no fixtures, and those of a new goal are there."""
    program = find_program(name)
    named: dict[str, set[str]] = {"instruction_switch": {"akita_black_bowl_1", "plate_1"}}
    for case in load_track("lite"):
        if not case.fits(program):
            continue
        objects = variation_metadata(variation_of(case)).objects
        out = {change["object"] for change in case.event.setup}
        lifted = set() if name == "instruction_switch" else {case.event.entity}
        assert named.get(name, set()) | lifted <= objects.keys() - out, case.item_id


@pytest.mark.parametrize("name", ["moving", "irregular"])
def test_a_moving_object_ends_where_the_event_would_have_put_it(name: str) -> None:
    for case in load_track("smoke").playing(find_program(name)):
        if case.program is None:
            continue
        for arm in arms_of(case)[1:]:
            moves = [entry.action for entry in arm.schedule]
            ways = [move.delta_position_m for move in moves if isinstance(move, MoveObject)]
            assert len(ways) == len(moves)
            whole = change_of(case)
            assert isinstance(whole, MoveObject)
            assert tuple(map(sum, zip(*ways, strict=True))) == pytest.approx(whole.delta_position_m)


def test_an_entry_that_happens_several_times_is_as_many_entries() -> None:
    step = {"type": "steps_after", "steps": 2}
    case = laid(
        {"trigger": "event", "change": "event"},
        {"trigger": step, "change": "event", "strength": 0.5, "times": 3},
    )
    half = Entry(StepsAfter(2), change_of(case, 0.5))
    assert arms_of(case)[2].schedule == (Entry(trigger_of(case), change_of(case)), half, half, half)


def test_a_case_that_its_own_program_does_not_fit_is_refused() -> None:
    case = laid({"trigger": "event", "change": "event"})
    assert case.program is not None
    odd = replace(case.program, only={"suite": ("libero_goal",)}, because="It needs a stove.")
    with pytest.raises(ManifestError, match=r"'tried' .*stove"):
        check_cases([replace(case, program=odd)])


def test_drawn_times_follow_from_the_seed_of_the_case() -> None:
    spans, seen = [], {}
    for case in load_track("lite").playing(find_program("recurrent_seeded")):
        if case.program is None:
            continue
        _, dynamic, regular, lasting = arms_of(case)
        assert arms_of(replace(case, policy_seed=1, case_id="other"))[1] == dynamic
        assert regular.schedule[0] == lasting.schedule[0] == dynamic.schedule[0]
        times = [entry.trigger.steps for entry in dynamic.schedule if isinstance(entry.trigger, StepsAfter)]
        spans += times
        seen[case.event.seed] = times
    assert set(spans) == set(range(5, 16))
    assert sum(spans) / len(spans) == pytest.approx(10, abs=0.3)
    assert len(set(map(tuple, seen.values()))) > 0.99 * len(seen)


def test_each_of_several_entries_draws_its_own_number() -> None:
    later = {"type": "steps_after", "steps": {"drawn": [1, 1000]}}
    case = laid(
        {"trigger": "event", "change": "event"},
        {"trigger": later, "change": "event", "times": 3},
        name="dynamic",
    )
    times = [entry.trigger.steps for entry in arms_of(case)[1].schedule[1:]]  # type: ignore[attr-defined]
    assert len(set(times)) == 3
    other = replace(case, event=replace(case.event, seed=case.event.seed + 1))
    assert arms_of(other)[1] != arms_of(case)[1]


@pytest.mark.parametrize(
    ("drawn", "message"),
    [
        ([9, 3], r"steps={'drawn': \[9, 3\]}, "),
        ([0, 3], r"steps\.drawn\[0\]=0, "),
        ([3], r"steps\.drawn"),
        ("5-15", r"steps\.drawn"),
    ],
)
def test_a_draw_that_is_spelled_wrong_is_refused_before_anything_is_played(drawn: Any, message: str) -> None:
    later = {"type": "steps_after", "steps": {"drawn": drawn}}
    case = laid({"trigger": "event", "change": "event"}, {"trigger": later, "reverts": 0})
    with pytest.raises(ManifestError, match=rf"arms\[0\]\.schedule\[1\]\.trigger\.{message}"):
        check_cases([case])


def test_an_object_is_bumped_into_at_a_step_at_which_it_is_held() -> None:
    for case in load_track("smoke").playing(find_program("bump")):
        for arm in arms_of(case)[1:] if case.program is not None else ():
            bumps = [entry for entry in arm.schedule if isinstance(entry.action, BumpObject)]
            assert [entry.trigger for entry in bumps] == [AfterGrasp(case.event.entity)]
