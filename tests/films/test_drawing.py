from __future__ import annotations

from pathlib import Path

import numpy as np
from msgspec.structs import replace
from PIL import ImageColor

from pytest_libero_max.changes import Nothing
from pytest_libero_max.events.schedules import Arm, Entry, arms_of, change_of, program_of, trigger_of
from pytest_libero_max.events.triggers import StepsAfter
from pytest_libero_max.films.drawing import film_frames, labels, shared_steps, strip_px
from pytest_libero_max.films.replay import Tick, play_again, through_cameras
from pytest_libero_max.pairing.record import PROGRAM, PairRecord
from pytest_libero_max.report.happenings import arm_title
from pytest_libero_max.report.palette import EVENT
from pytest_libero_max.runs.media import distinct_arms
from pytest_libero_max.worlds.contract import Image
from pytest_libero_max.worlds.robot import CONTROL_HZ

from .short_run import BUDGET, SIZE, Played, play


def _words(record: PairRecord, arm: str, step: int) -> list[str]:
    shared = shared_steps(record, distinct_arms(record))
    return [label.words for label in labels(record, arm, step, shared)]


def _frames(played: Played) -> list[Image]:
    ticks = play_again(played.case, played.world, played.record, played.traces, through_cameras(SIZE))
    return [frame for _, frame in film_frames(played.record, played.traces, ticks, SIZE)]


def test_an_arm_with_a_policy_of_its_own_is_titled_with_it(played: Played) -> None:
    dynamic = played.record.arms["dynamic"]
    assert arm_title("dynamic", dynamic) == "Dynamic"
    assert arm_title("dynamic_other", replace(dynamic, policy={"name": "other"})) == "dynamic other (other)"


def test_the_words_tell_prefix_event_stale_actions_and_end(played: Played) -> None:
    record = played.record
    event, answer = record.trigger_step, record.response_step
    assert (event, answer, record.stale_actions) == (4, 6, 2)
    assert [_words(record, "base", step) for step in range(BUDGET + 1)] == [
        *[["shared prefix"]] * 4,
        *[[]] * 4,
        ["failed after 8 steps"],
    ]
    name = "EVENT target_relocation v0"
    assert [_words(record, "dynamic", step) for step in range(BUDGET + 1)] == [
        *[["shared prefix"]] * 4,
        [name],
        [name, "stale action 1 of 2"],
        [name, "stale action 2 of 2"],
        [name],
        [name, "failed after 8 steps"],
    ]
    assert name not in _words(record, "dynamic", 4 + CONTROL_HZ)


def test_what_a_program_does_is_one_label_that_names_the_change(tmp_path: Path) -> None:
    case = play(tmp_path).case
    first = Entry(trigger_of(case), change_of(case, 0.5))
    again = Entry(StepsAfter(1), change_of(case, 0.25))
    waiting = Entry(StepsAfter(1), Nothing())
    program = program_of("moving", (Arm("dynamic", (first, again, again, waiting)),))
    laid = case.playing(program)
    record = play(tmp_path, arms_of(laid)).record
    record = replace(record, fingerprints={**record.fingerprints, PROGRAM: "moving"})
    moved = "EVENT object moved"
    labels = [_words(record, "dynamic", step)[0] for step in (4, 5, 6, 7)]
    assert labels == [moved, *(f"{moved}, {times} times" for times in (2, 3, 3))]
    assert record.arms["dynamic"].firings[-1].step == 7
    assert not any("nothing" in word for word in _words(record, "dynamic", 7))


def test_an_arm_that_completes_the_task_says_so(played: Played) -> None:
    arms = {name: replace(arm, success=True) for name, arm in played.record.arms.items()}
    assert _words(replace(played.record, arms=arms), "base", BUDGET) == ["success after 8 steps"]


def test_frames_have_one_even_size_and_show_the_pictures_side_by_side(played: Played) -> None:
    frames = _frames(played)
    assert len(frames) == BUDGET + 1
    assert len({frame.shape for frame in frames}) == 1
    assert all(side % 2 == 0 for side in frames[0].shape[:2])
    ticks = play_again(played.case, played.world, played.record, played.traces, through_cameras(SIZE))
    for tick, frame in zip(ticks, frames, strict=True):
        if tick.step == BUDGET:
            continue  # faded
        for column, view in enumerate(tick.views.values()):
            assert ("agentview" in view.outlines) == (
                column == 1 and tick.step >= (played.record.trigger_step or 0)
            )
            if view.outlines:
                continue  # drawn over
            left = column * (SIZE + 4)
            wrist = view.images["robot0_eye_in_hand"][8:-8, 8:-8]
            part = frame[:, left + 8 : left + SIZE - 8]
            assert any(
                (part[top : top + SIZE - 16] == wrist).all() for top in range(len(part) - SIZE + 16 + 1)
            )


def test_the_event_is_framed_for_a_second_and_in_its_arm_alone(played: Played) -> None:
    amber = np.array(ImageColor.getrgb(EVENT))
    event = played.record.trigger_step
    for step, frame in enumerate(_frames(played)):
        pictures = frame[: -strip_px(SIZE)]
        found = (pictures == amber).all(axis=2)
        assert not found[:, : SIZE + 1].any()
        assert found[:, SIZE + 4 :].any() == (event is not None and step >= event)


def test_the_same_pair_gives_the_same_frames(played: Played) -> None:
    assert all((one == other).all() for one, other in zip(_frames(played), _frames(played), strict=True))


def test_a_pair_without_an_event_is_one_column(tmp_path: Path) -> None:
    played = play(tmp_path, wait=BUDGET)
    assert _words(played.record, "base", 1) == []
    assert _frames(played)[0].shape[1] == SIZE


def test_the_old_place_of_what_an_event_moved_is_outlined_where_it_was(played: Played) -> None:
    ticks = play_again(played.case, played.world, played.record, played.traces, through_cameras(SIZE))
    views = [tick.views["dynamic"] for tick in ticks]
    event = played.record.trigger_step
    assert event is not None
    before, after = (view.images["agentview"].astype(int) for view in (views[event - 1], views[event]))
    (outline,) = views[-1].outlines["agentview"]
    (left, top), (right, bottom) = outline.min(axis=0), outline.max(axis=0)
    changed = np.abs(after - before).sum(axis=2) > 60
    assert changed[top : bottom + 1, left : right + 1].mean() > 0.3
    assert (right - left) * (bottom - top) < 0.2 * SIZE * SIZE


def test_a_frame_stays_while_nothing_moves(tmp_path: Path) -> None:
    played = play(tmp_path, wait=BUDGET)
    ticks = list(play_again(played.case, played.world, played.record, played.traces, through_cameras(SIZE)))
    still = [Tick(step, ticks[0].views) for step in range(2 * CONTROL_HZ + 5)]
    shown = [step for step, _ in film_frames(played.record, played.traces, still, SIZE)]
    assert shown == [0, BUDGET, BUDGET + CONTROL_HZ, 2 * CONTROL_HZ + 4]
