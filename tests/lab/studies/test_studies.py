"""The arms of the studies, played on the tiny world."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.latency import Latency
from pytest_libero_max.benchmark.programs import parse_program
from pytest_libero_max.errors import (
    AdapterError,
    ChangeError,
    LiberoMaxError,
    OptionError,
    ProtocolError,
    ReportError,
)
from pytest_libero_max.events.schedules import Arm, Cadence, arms_of, change_of
from pytest_libero_max.lab.studies.camera.arms import first_crossing
from pytest_libero_max.lab.studies.sweeps import CadenceSweep
from pytest_libero_max.pairing.runner import PairSettings, inject, measure_pair
from pytest_libero_max.policies.contract import Query
from pytest_libero_max.report.studies.study_results import executed
from pytest_libero_max.studies.playable import require_playable
from pytest_libero_max.studies.registry import STUDIES, find_study, spelled_study, study_from_dict
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from tests.pairing.actors import BUDGET, CHANGES, Approaching, make_case

CAMERA_FIELDS = ("cam_pos", "cam_quat", "cam_fovy")


class Cutting(Approaching):
    """Returns as many actions as its spec declares at the moment."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        self.length = self.spec.horizon
        return super().predict(observation, query)


@pytest.fixture(scope="module")
def world() -> Iterator[TinyWorld]:
    world = TinyWorld()
    yield world
    world.close()


def all_arms(study: Any, policy: Approaching, strength: float = 1.0) -> tuple[Arm, ...]:
    case = make_case(distance_m=0.25)
    return (*arms_of(case, strength=strength), *study.arms(case, policy.spec, strength))


QUIET = settings(max_examples=4, suppress_health_check=[HealthCheck.function_scoped_fixture])
POLICIES = st.builds(Approaching, wait=st.integers(0, 8), horizon=st.just(8), interval=st.integers(1, 8))
PREFIXES = st.sampled_from([PairSettings("fork"), PairSettings("replay")])


@pytest.mark.parametrize("event", CHANGES)
@QUIET
@given(policy=POLICIES, how=PREFIXES)
def test_strength_0_equals_base_bit_for_bit(
    world: TinyWorld, event: str, policy: Approaching, how: PairSettings
) -> None:
    case = make_case(event, distance_m=0.25)
    pair = measure_pair(case, world, policy, how, arms=arms_of(case, strength=0.0))
    base, dynamic = pair.record.arms["base"], pair.record.arms["dynamic"]
    assert dynamic.firings
    assert (base.proof, base.success, base.steps) == (dynamic.proof, dynamic.success, dynamic.steps)
    one, other = pair.rollouts["base"], pair.rollouts["dynamic"]
    for name in ("actions", "end_effector", "entity"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


@pytest.mark.parametrize("event", CHANGES)
def test_reset_has_the_change_before_the_first_query_and_leaves_the_pair_as_it_is(
    world: TinyWorld, event: str
) -> None:
    case, policy = make_case(event, distance_m=0.25), Approaching(wait=2)
    plain = measure_pair(case, world, policy).record
    arms = (*arms_of(case), *find_study("event-timing").arms(case, policy.spec))
    studied = measure_pair(case, world, policy, arms=arms).record
    assert {name: studied.arms[name].proof for name in plain.arms} == {
        name: arm.proof for name, arm in plain.arms.items()
    }
    (firing,) = studied.arms["reset"].firings
    assert (firing.step, firing.queries) == (0, 0)
    assert plain.evidence is not None
    assert firing.evidence["operation"] == plain.evidence["operation"]


@pytest.mark.parametrize("event", CHANGES)
def test_a_strength_scales_the_change_and_nothing_else(world: TinyWorld, event: str) -> None:
    case = make_case(event, distance_m=0.25)
    whole = measure_pair(case, world, Approaching(wait=2)).record
    half = measure_pair(case, world, Approaching(wait=2), arms=arms_of(case, strength=0.5)).record
    assert half.arms["base"] == whole.arms["base"]
    assert half.trigger is not None
    assert whole.trigger is not None
    assert half.trigger.prefix_proof == whole.trigger.prefix_proof
    assert half.arms["dynamic"].schedule == (
        {
            "trigger": {"type": "on_proximity", "value": "box_1", "distance_m": 0.25},
            "change": change_of(case, 0.5).to_dict(),
        },
    )
    world.reset(0)
    assert inject(case, world, strength=0.5)["operation"] == CHANGES[event].operation


def test_events_that_happen_whole_or_not_at_all_are_refused_with_a_cure() -> None:
    obstacle = {"operation": "remove_object", "object": "box_1", "offworld_position_m": [0.0, 0.0, 9.0]}
    fixed = make_case()
    whole = replace(fixed, event=replace(fixed.event, change=obstacle))
    with pytest.raises(ChangeError, match="all or nothing"):
        change_of(whole, 0.5)
    broken = replace(fixed, event=replace(fixed.event, change={"operation": "remove_object"}))
    with pytest.raises(ChangeError, match="lacks"):
        require_playable([broken], 0.5, None)
    assert change_of(whole, 0.0).operation == "nothing"
    require_playable([whole], 0.0, None)
    with pytest.raises(
        OptionError, match=r"strength=0\.5, .* camera_shift \(2 cases\)\. .* -m 'not camera_shift'"
    ):
        require_playable([whole, whole], 0.5, None)


GOES_ON = {"name": "other", "policy": "noop", "schedule": [{"trigger": "event", "change": "event"}]}


@pytest.mark.parametrize(
    ("arm", "latency", "message"),
    [
        ({}, "0steps", None),
        ({"latency": "4steps"}, "0steps", "arm 'other' has policy='noop', which goes on where"),
        ({"latency": "4steps"}, "4steps", None),  # that of Base as well
        ({"repetition": 1}, "0steps", "play an arm of the same latency and repetition"),
        ({"policy": "nop"}, "0steps", "Did you mean 'noop'"),
    ],
)
def test_an_arm_that_cannot_be_played_is_found_before_any_pair(
    arm: Json, latency: str, message: str | None
) -> None:
    document = {"name": "handed_over", "arms": [{**GOES_ON, **arm}]}
    case = make_case()
    study = spelled_study({**document, "title": "Handed over"})
    for cases, beside in (([replace(case, program=parse_program(document))] * 2, None), ([case], study)):
        with nullcontext() if message is None else pytest.raises(LiberoMaxError, match=message):
            require_playable(cases, 1.0, beside, Latency.parse(latency))


@QUIET
@given(policy=POLICIES, how=PREFIXES)
def test_reset_and_mid_task_end_with_the_same_camera_and_share_everything_with_the_pair(
    world: TinyWorld, policy: Approaching, how: PairSettings
) -> None:
    case = make_case(distance_m=0.25)
    plain = measure_pair(case, world, policy, how).record
    study = find_study("camera-strength")
    pair = measure_pair(case, world, policy, how, arms=(*arms_of(case), *study.arms(case, policy.spec)))
    study.check(pair)
    arms = pair.record.arms
    assert (arms["base"], arms["dynamic"]) == (plain.arms["base"], plain.arms["dynamic"])
    assert len(arms) == 7
    for end in ("_25", "_50", ""):
        reset, middle = arms[f"reset{end}"], arms[f"dynamic{end}"]
        assert reset.firings[0].step == reset.stale_actions == 0
        if middle.firings:
            assert reset.firings[0].evidence["after"] == middle.firings[0].evidence["after"]
            assert middle.firings[0].step == first_crossing(pair.rollouts[f"dynamic{end}"], 0.25)
    fired = [bool(arms[name].firings) for name in ("dynamic_25", "dynamic_50", "dynamic")]
    assert len(set(fired)) == 1


def test_the_model_holds_the_same_camera_at_the_end_of_both(world: TinyWorld) -> None:
    case, study = make_case(distance_m=0.25), find_study("camera-timing")
    (reset,) = study.arms(case, Approaching().spec)
    ends = []
    for arm in (reset, arms_of(case)[1]):
        record = measure_pair(case, world, Approaching(wait=2), arms=(arm,)).record
        assert record.arms[arm.name].firings
        ends.append([getattr(world.model, name).tobytes() for name in CAMERA_FIELDS])
    assert ends[0] == ends[1]
    world.reset(0)
    assert [getattr(world.model, name).tobytes() for name in CAMERA_FIELDS] != ends[0]


def test_a_study_finds_a_wrong_log_and_a_camera_that_somebody_moved(world: TinyWorld) -> None:
    case, study, policy = make_case(distance_m=0.25), find_study("camera-timing"), Approaching(wait=2)
    pair = measure_pair(case, world, policy, arms=all_arms(study, policy))
    study.check(pair)
    arms = dict(pair.record.arms)
    (firing,) = arms["dynamic"].firings
    later = structs.replace(arms["dynamic"], firings=(structs.replace(firing, step=firing.step + 1),))
    with pytest.raises(ProtocolError, match="logged at step"):
        study.check(replace(pair, record=structs.replace(pair.record, arms={**arms, "dynamic": later})))
    moved = structs.replace(firing, evidence={**firing.evidence, "after": {"camera_fovy_deg": 1.0}})
    elsewhere = structs.replace(arms["dynamic"], firings=(moved,))
    with pytest.raises(ProtocolError, match="the camera is"):
        study.check(replace(pair, record=structs.replace(pair.record, arms={**arms, "dynamic": elsewhere})))


def test_a_camera_study_refuses_other_events() -> None:
    study = find_study("camera-timing")
    assert study.objection(make_case()) is None
    with pytest.raises(OptionError, match=r"target_relocation \(1 case\): the event"):
        require_playable([make_case(), make_case("target_relocation")], 1.0, study)


def test_what_shared_arms_save_is_counted(world: TinyWorld) -> None:
    policy, played = Approaching(wait=2), 0

    class Counting(TinyWorld):
        def step(self, action: Any) -> None:
            nonlocal played
            played += 1
            super().step(action)

    counting = Counting()
    try:
        pair = measure_pair(
            make_case(distance_m=0.25), counting, policy, arms=all_arms(find_study("camera-strength"), policy)
        )
    finally:
        counting.close()
    done = executed([pair.record])
    assert done.steps == played - 10  # the settle steps
    assert done.arms == 7
    assert done.steps_singly == 7 * BUDGET
    assert done.steps_as_pairs == done.steps + 5 * BUDGET
    assert done.steps == 7 * BUDGET - 3 * (pair.record.trigger_step or 0)


@pytest.mark.parametrize("prefix", ["fork", "replay"])
def test_every_setting_is_played_as_a_run_of_that_cadence(world: TinyWorld, prefix: Any) -> None:
    case, how = make_case(distance_m=0.25), PairSettings(prefix)
    study = CadenceSweep.of("2,4,2/2,8/4")
    policy = Cutting(wait=3, horizon=6, interval=4)
    arms = (*arms_of(case), *study.arms(case, policy.spec))
    assert [arm.name for arm in arms[2:]] == [
        "base_q2",
        "dynamic_q2",
        "base_h2q2",
        "dynamic_h2q2",
        "base_h8q4",
        "dynamic_h8q4",
    ]
    record = measure_pair(case, world, policy, how, arms=arms).record
    assert (policy.spec.horizon, policy.spec.query_interval) == (6, 4)
    assert record.policy["query_interval"] == 4
    for end, horizon, interval in (("", 6, 4), ("_q2", 6, 2), ("_h2q2", 2, 2), ("_h8q4", 8, 4)):
        alone = measure_pair(case, world, Cutting(wait=3, horizon=horizon, interval=interval), how).record
        for name in ("base", "dynamic"):
            assert record.arms[name + end] == alone.arms[name]


def test_a_policy_declares_its_own_cadence_again_after_an_error(world: TinyWorld) -> None:
    case, policy = make_case(distance_m=0.25), Approaching(wait=2, horizon=4, interval=2)
    arms = CadenceSweep.of("2/2").arms(case, policy.spec)
    with pytest.raises(AdapterError, match="4 actions > horizon=2"):
        measure_pair(case, world, policy, arms=arms)
    assert (policy.spec.horizon, policy.spec.query_interval) == (4, 2)


def test_a_spec_that_cannot_be_assigned_is_named(world: TinyWorld) -> None:
    class Fixed(Approaching):
        def __setattr__(self, name: str, value: Any) -> None:
            if name == "spec" and hasattr(self, "spec"):
                raise AttributeError("no setter")
            super().__setattr__(name, value)

    with pytest.raises(AdapterError, match="Make `spec` a plain attribute"):
        measure_pair(make_case(), world, Fixed(horizon=4), arms=(Arm("base", cadence=Cadence(2)),))


def test_a_q_above_h_is_refused_before_anything_is_played() -> None:
    with pytest.raises(AdapterError, match="query_interval=8 > horizon=4 of policy"):
        CadenceSweep.of("2,8").check_policy(Approaching(horizon=4).spec)
    with pytest.raises(OptionError, match="query_interval=8 and horizon=4"):
        CadenceSweep.of("4/8")


@pytest.mark.parametrize("text", ["", "0", "2,,4", "2;4", "4/", "-2", "2/2/2", "2,2", "1e3", "99999"])
def test_settings_of_another_form_are_refused(text: str) -> None:
    with pytest.raises(OptionError, match=r"H/Q|each once"):
        CadenceSweep.of(text)


@given(
    st.lists(
        st.integers(1, 50).flatmap(
            lambda q: st.one_of(st.none(), st.integers(q, 60)).map(lambda h: Cadence(q, h))
        ),
        min_size=1,
        max_size=6,
        unique=True,
    )
)
def test_settings_are_read_as_they_are_written(cadences: list[Cadence]) -> None:
    texts = [("" if one.horizon is None else f"{one.horizon}/") + str(one.query_interval) for one in cadences]
    study = CadenceSweep(*texts)
    assert [Cadence(**arm["cadence"]) for arm in study.spelled] == [one for one in cadences for _ in range(2)]
    assert study_from_dict(study.to_dict()).to_dict() == study.to_dict()


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_is_read_from_the_header_of_its_run(name: str) -> None:
    study = STUDIES[name]({"cadence": "2", "latency": "2,2sync", "continue": "expert"}.get(name))
    read = study_from_dict(study.to_dict())
    assert (type(read), read.to_dict(), read.spelled) == (type(study), study.to_dict(), study.spelled)
    damage: list[Any] = [{"name": name, "more": 1}, {"name": "weather"}, [], {"name": name, "settings": 1}]
    for damaged in damage:
        with pytest.raises(ReportError, match="none that"):
            study_from_dict(damaged)


def test_settings_belong_to_one_study() -> None:
    with pytest.raises(OptionError, match="needs its settings"):
        STUDIES["cadence"](None)
    with pytest.raises(OptionError, match="camera-timing"):
        STUDIES["camera-timing"]("2")


def test_a_name_alone_stands_for_a_study_of_the_lab() -> None:
    assert find_study("camera-strength").scales
    assert find_study("camera-timing").to_dict() == {"name": "camera-timing"}
    assert [arm["name"] for arm in find_study("latency:2,4sync").spelled][::2] == ["base_d2", "base_d4sync"]
    case, spec = make_case(), Approaching(horizon=8, interval=4).spec
    assert [arm.name for arm in find_study("cadence:2,4").arms(case, spec)] == ["base_q2", "dynamic_q2"]
