from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from pytest_libero_max.changes.registry import change_from_dict
from pytest_libero_max.errors import ProtocolError, ReportError
from pytest_libero_max.events.schedules import Arm, Entry, Revert, arms_of, trigger_of
from pytest_libero_max.events.triggers import StepsAfter
from pytest_libero_max.films.replay import Tick, View, opening_m, play_again, through_cameras
from pytest_libero_max.runs.media import distinct_arms
from pytest_libero_max.substrates.tiny.world import TinyWorld
from pytest_libero_max.worlds.contract import Observation
from pytest_libero_max.worlds.robot import CAMERAS
from tests.pairing.actors import Posing

from .short_run import BUDGET, SIZE, Played, play


def _ticks(played: Played, every: int = 1) -> list[Tick]:
    return list(
        play_again(played.case, played.world, played.record, played.traces, through_cameras(SIZE), every)
    )


def _differ(one: View, other: View) -> bool:
    return any((one.images[camera] != other.images[camera]).any() for camera in CAMERAS)


def test_every_step_of_every_arm_is_seen_through_both_cameras(played: Played) -> None:
    ticks = _ticks(played)
    assert [tick.step for tick in ticks] == list(range(BUDGET + 1))
    for tick in ticks:
        assert list(tick.views) == ["base", "dynamic"]
        for view in tick.views.values():
            assert list(view.images) == list(CAMERAS)
            assert {(image.shape, image.dtype.name) for image in view.images.values()} == {
                ((SIZE, SIZE, 3), "uint8")
            }


def test_the_arms_look_the_same_until_the_event_and_not_afterwards(played: Played) -> None:
    event = played.record.trigger_step
    assert event is not None
    assert 0 < event < BUDGET
    for tick in _ticks(played):
        assert _differ(tick.views["base"], tick.views["dynamic"]) == (tick.step >= event)


@pytest.mark.parametrize("fingers", [(0.03, -0.03), (0.03, 0.03), (0.06,)])
def test_the_opening_is_the_same_whichever_signs_the_fingers_have(
    played: Played, fingers: tuple[float, ...]
) -> None:
    key = played.world.robot.fingers_key
    assert opening_m(played.world, {key: np.array(fingers)}) == pytest.approx(0.06)


def test_what_is_shown_is_what_the_policy_would_have_seen(played: Played) -> None:
    world = played.world
    last = _ticks(played)[-1].views["dynamic"]
    rollout = played.pair.dynamic
    assert rollout is not None
    world.reset(played.case.init_state_index)
    for change in played.case.event.setup:
        change_from_dict(change).apply(world)
    for _ in range(10):
        world.step((0, 0, 0, 0, 0, 0, -1))
    for step, action in enumerate(rollout.actions):
        if step == played.record.trigger_step:
            change_from_dict(played.case.event.change).apply(world)
        world.step(action)
    seen = world.observe(CAMERAS, SIZE)
    for camera in CAMERAS:
        assert (last.images[camera] == seen[f"{camera}_image"][::-1]).all()
    assert last.opening_m == pytest.approx(np.ptp(seen["robot0_gripper_qpos"]))


def test_kept_positions_show_what_a_replay_shows(tmp_path: Path) -> None:
    case = play(tmp_path).case
    there = Entry(trigger_of(case), change_from_dict(case.event.change))
    flash = Arm("flash", (there, Entry(StepsAfter(2), Revert(0))))
    played = play(tmp_path, (*arms_of(case), flash), films=True)
    assert all(trace.joints is not None for trace in played.traces.values())
    taken = {**played.traces, "base": replace(played.traces["base"], actions=np.zeros((BUDGET, 7)))}
    look = through_cameras(SIZE)
    shown = play_again(played.case, played.world, played.record, taken, look, simulate=False)
    for tick, simulated in zip(list(shown), _ticks(played), strict=True):
        for name, view in tick.views.items():
            for camera in CAMERAS:
                expected = simulated.views[name].images[camera].astype(int)
                assert np.abs(view.images[camera] - expected).max() < 16
            assert view.opening_m == pytest.approx(simulated.views[name].opening_m, abs=1e-6)


def test_a_world_that_stands_still_is_drawn_once(played: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    world, drawn = played.world, list[Sequence[str]]()
    world.reset(played.case.init_state_index)
    observe = world.observe

    def counted(cameras: Sequence[str], size: int) -> Observation:
        drawn.append(cameras)
        return observe(cameras, size)

    monkeypatch.setattr(world, "observe", counted)
    look = through_cameras(SIZE)
    first = look("base", 0, world, None)
    assert look("base", 1, world, first).images is first.images
    assert [cameras for cameras in drawn if cameras] == [CAMERAS]
    change_from_dict(played.case.event.change).apply(world)
    assert look("base", 2, world, first).images is not first.images


def test_steps_can_be_left_out_but_never_the_last(played: Played) -> None:
    every = {tick.step: tick for tick in _ticks(played)}
    some = _ticks(played, every=3)
    assert [tick.step for tick in some] == [0, 3, 4, 6, 8]  # the event is after 4
    for tick in some:
        for name, view in tick.views.items():
            assert not _differ(view, every[tick.step].views[name])


def test_an_arm_that_has_ended_is_held_on_its_last_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solved(world: TinyWorld) -> bool:
        return world.steps >= 15 and bool(np.abs(world.position("box_1")[:2] - (0.1, -0.1)).max() < 0.01)

    monkeypatch.setattr(TinyWorld, "succeeded", solved)
    played = play(tmp_path)
    record = played.record
    assert (record.base_success, record.dynamic_success) == (True, False)
    for every in (1, 2):
        ticks = _ticks(played, every)
        end = record.base_steps
        held = [tick.views["base"] for tick in ticks if tick.step >= end]
        assert len(held) > 1
        assert not any(_differ(view, held[0]) for view in held)
        assert _differ(ticks[0].views["base"], held[0])


@pytest.mark.parametrize(
    ("arm", "where"),
    [("base", "'base' is not what was recorded, at its end"), ("dynamic", "before its event")],
)
def test_a_replay_that_reaches_other_states_is_refused(played: Played, arm: str, where: str) -> None:
    traces = played.traces
    actions = traces[arm].actions.copy()
    actions[BUDGET - 1 if arm == "base" else 0, 0] += 1e-9
    traces[arm] = replace(traces[arm], actions=actions)
    with pytest.raises(ProtocolError, match=where):
        list(play_again(played.case, played.world, played.record, traces, through_cameras(SIZE)))


def test_recorded_poses_are_played_as_poses(tmp_path: Path) -> None:
    played = play(tmp_path, policy=Posing(5, 3))
    assert played.record.trigger_step is not None
    assert [tick.step for tick in _ticks(played, every=4)] == [0, 3, 4, 8]
    movements = structs.replace(played.record, policy={**played.record.policy, "control": "delta"})
    with pytest.raises(ProtocolError, match="what was recorded"):
        list(play_again(played.case, played.world, movements, played.traces, through_cameras(SIZE)))


def test_another_version_of_the_case_is_refused(played: Played) -> None:
    other = replace(played.case, record={**played.case.record, "policy_seed": 7})
    with pytest.raises(ReportError, match="another case"):
        list(play_again(other, played.world, played.record, played.traces, through_cameras(SIZE)))


def test_arms_with_more_events_and_their_reversal_are_played_as_well(tmp_path: Path) -> None:
    case = play(tmp_path).case
    there = Entry(trigger_of(case), change_from_dict(case.event.change))
    flash = Arm("flash", (there, Entry(StepsAfter(2), Revert(0))))
    played = play(tmp_path, (*arms_of(case, repeat_base=True), flash))
    assert distinct_arms(played.record) == ("base", "dynamic", "flash")
    event = played.record.trigger_step
    assert event is not None
    for tick in _ticks(played):
        views = tick.views
        assert _differ(views["flash"], views["dynamic"]) == (tick.step >= event + 2)


def test_an_arm_whose_event_ends_before_that_of_the_next_arm_is_played_as_well(tmp_path: Path) -> None:
    case = play(tmp_path).case
    there = Entry(trigger_of(case), change_from_dict(case.event.change))
    flash = (there, Entry(StepsAfter(2), Revert(0)))
    played = play(tmp_path, (Arm("base"), Arm("dynamic", flash), Arm("lasting", (there,))))
    event = played.record.trigger_step
    assert event is not None
    for tick in _ticks(played):
        assert _differ(tick.views["dynamic"], tick.views["lasting"]) == (tick.step >= event + 2)


def test_a_pair_without_an_event_has_one_arm(tmp_path: Path) -> None:
    played = play(tmp_path, wait=BUDGET)
    assert distinct_arms(played.record) == ("base",)
    assert {tuple(tick.views) for tick in _ticks(played)} == {("base",)}
