"""A world without MuJoCo keeps the rules, hosts every event, forks as it replays, and is filmed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pytest_libero_max
from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.latency import Latency
from pytest_libero_max.benchmark.manifests import decode_manifest
from pytest_libero_max.changes import (
    CoverEntity,
    HideInputs,
    OffsetArm,
    PutObject,
    SetLamps,
    SetTask,
    SetTexture,
    SetVisualTheme,
)
from pytest_libero_max.conformance.registry import rules_for
from pytest_libero_max.conformance.rules import Examination
from pytest_libero_max.conformance.substrate.subject import SubstrateSubject
from pytest_libero_max.errors import ChangeError
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.films.replay import play_again, through_cameras
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.pairing.trace import traces_of
from pytest_libero_max.policies.contract import Episode, PolicySpec, Query
from pytest_libero_max.worlds.contract import AlterableWorld, Observation, OnMujoco, PosedWorld, World
from pytest_libero_max.worlds.robot import Robot
from tests.plugin.conftest import tiny_manifest
from tests.worlds.numpy_world import NumpySubstrate, NumpyWorld

CASES = decode_manifest(json.dumps(tiny_manifest()).encode(), Path("numpy.json")).cases
SIZE = 24
WORLD = NumpyWorld()


class Placing:
    """Brings the box from where it begins to where the plate does, as a function of the step alone."""

    spec = PolicySpec("placing", 8, 4, image_size=SIZE)
    WAY = (
        ((0.1, -0.1, 0.6), -1),
        ((0.1, -0.1, 0.43), -1),
        ((0.1, -0.1, 0.43), 1),
        ((0.1, -0.1, 0.6), 1),
        ((0.1, 0.15, 0.6), 1),
        ((0.1, 0.15, 0.46), 1),
        ((0.1, 0.15, 0.46), -1),
    )

    def reset(self, episode: Episode) -> None:
        pass

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        goal, grip = self.WAY[min(query.step // 8, len(self.WAY) - 1)]
        way = (np.array(goal) - observation["robot0_eef_pos"]) / 0.05
        steps = np.array([np.clip(way - number * np.clip(way, -1, 1), -1, 1) for number in range(8)])
        return np.hstack([steps, np.zeros((8, 3)), np.full((8, 1), float(grip))])


def played(case: Case, prefix: Any) -> dict[str, Any]:
    record = measure_pair(case, WORLD, Placing(), PairSettings(prefix)).record.to_dict()
    return {name: value for name, value in record.items() if name != "timings"}


def test_it_is_a_world_that_changes_alter_and_has_no_mujoco() -> None:
    assert isinstance(WORLD, World)
    assert isinstance(WORLD, AlterableWorld)
    assert isinstance(WORLD, PosedWorld)
    assert not isinstance(WORLD, OnMujoco)


def test_it_keeps_the_rules_of_substrates() -> None:
    subject = SubstrateSubject(NumpySubstrate(), CASES)
    outcomes = Examination(lambda: subject, rules_for("substrate")).outcomes()
    states = {outcome.rule.id.removeprefix("substrate/"): outcome.state for outcome in outcomes}
    assert {name for name, state in states.items() if state == "broken"} == set()
    of_mujoco = {"contract/rate", "states/complete", "states/writes", "states/process"}
    assert {name for name, state in states.items() if state == "unexamined"} <= {*of_mujoco, "images/rows"}
    assert sum(name.startswith("events/") for name in states) == 8


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.item_id)
def test_every_event_happens_and_a_fork_equals_a_replay(case: Case) -> None:
    forked = played(case, "fork")
    assert forked == played(case, "replay")
    assert forked["arms"]["base"]["success"]
    assert forked["arms"]["dynamic"]["firings"]


class Posing(Placing):
    """Asks for places of a hand that does not turn."""

    spec = PolicySpec("posing", 2, 2, cameras=(), control="absolute", robot=None)

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        return np.tile([0.1, -0.1, 0.6, -1.0], (2, 1))


def test_a_hand_of_four_components_waits_under_absolute_control() -> None:
    slider = Robot(
        name="slider", noop=(0.0, 0.0, 0.0, -1.0), state={"robot0_joint_pos": 3, "robot0_gripper_qpos": 1}
    )
    arms = tuple(replace(arm, latency=Latency(3, "sync")) for arm in arms_of(CASES[0]))
    pair = measure_pair(CASES[0], NumpyWorld(slider), Posing(), arms=arms)
    hand, actions = pair.base.end_effector, pair.base.actions
    assert actions[0].tolist() == [*hand[0], -1.0] == actions[2].tolist()
    assert actions[3].tolist() == [0.1, -0.1, 0.6, -1.0] == actions[6].tolist()


def test_a_relocation_moves_what_the_policy_does_not_look_for() -> None:
    moved = next(case for case in CASES if case.event.name == "target_relocation" and case.event.variant == 1)
    arms = played(moved, "fork")["arms"]
    assert (arms["base"]["success"], arms["dynamic"]["success"]) == (True, False)


def test_its_film_is_drawn_from_kept_positions() -> None:
    case = next(case for case in CASES if case.event.name == "target_relocation")
    pair = measure_pair(case, WORLD, Placing(), PairSettings(films=True))
    traces = traces_of(pair)
    kept, simulated = (
        list(play_again(case, WORLD, pair.record, traces, through_cameras(SIZE), 50, simulate=simulate))
        for simulate in (False, True)
    )
    assert any(view.outlines for moment in kept for view in moment.views.values())
    for one, other in zip(kept, simulated, strict=True):
        for arm, view in one.views.items():
            for camera, image in view.images.items():
                difference = np.abs(image.astype(int) - other.views[arm].images[camera].astype(int))
                assert difference.mean() < 2.0


@pytest.mark.parametrize(
    "change",
    [
        SetLamps(levels=(0.1, 0.2, 0.3), azimuth_degrees=30.0, cast_shadows=False),
        SetTexture("wood", "marble"),
        CoverEntity("main_table", (0.1, 0.9, 0.1)),
        OffsetArm((0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        PutObject("clutter_1", "plate_1", (0.1, 0.15)),
        SetTask("put it on the table", (("on", "box_1", "main_table"),)),
        HideInputs(("agentview",), True),
    ],
    ids=lambda change: change.operation,
)
def test_other_changes_alter_it_and_are_taken_back_bit_for_bit(change: Any) -> None:
    WORLD.reset(0)
    before = WORLD.digest()
    evidence = change.apply(WORLD)
    assert WORLD.digest() != before
    change.reverted(evidence).apply(WORLD)
    assert WORLD.digest() == before


def test_a_reversal_leaves_what_another_change_did_to_other_surfaces() -> None:
    WORLD.reset(0)
    cover, theme = CoverEntity("main_table", (0.1, 0.9, 0.1)), SetVisualTheme((1, 2, 0), (0.5, 0.6, 0.7))
    table = WORLD.surfaces().materials[0].copy()
    evidence = cover.apply(WORLD)
    theme.apply(WORLD)
    themed = WORLD.surfaces().parts[1:].copy()
    cover.reverted(evidence).apply(WORLD)
    assert np.array_equal(WORLD.surfaces().parts[1:], themed)
    assert np.array_equal(WORLD.surfaces().materials[0], table)


def _readings_of_mujoco(room: str) -> Iterator[str]:
    folder = Path(pytest_libero_max.__file__).parent / room
    for file in folder.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if re.search(r"\b\w*world\.(model|data)\b|\bOnMujoco\b|import mujoco\b", text):
            yield str(file.relative_to(folder.parent))


@pytest.mark.parametrize("room", ["changes", "events", "pairing", "policies", "films"])
def test_no_room_above_the_worlds_reads_mujoco(room: str) -> None:
    assert list(_readings_of_mujoco(room)) == []


def test_an_offset_of_other_joints_than_the_arm_has_is_refused() -> None:
    WORLD.reset(0)
    with pytest.raises(ChangeError, match="has 7 joints"):
        OffsetArm((0.1,) * 6).apply(WORLD)
