"""Fetch of gymnasium-robotics as a world: its declaration, its cases, and a scripted policy."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max import (
    Case,
    Episode,
    InitialPlacement,
    Manifest,
    MujocoRobot,
    PolicySpec,
    Query,
    Relation,
    Substrate,
    SubstrateKind,
    SubstrateOptions,
    Suite,
    TaskMetadata,
    Tracks,
    make_case,
)

Array = NDArray[np.float64]


FETCH = MujocoRobot(
    name="fetch",
    noop=(0.0, 0.0, 0.0, 1.0),  # Fetch opens its gripper with +1
    control_hz=25,
    cameras=("external_camera_0",),  # that of the gripper shows a white table, or the block from inside
    state={"observation": 25, "achieved_goal": 3, "desired_goal": 3, "arm": 7, "fingers": 2},
    joints_key="arm",
    fingers_key="fingers",
    arm_joints=(
        "robot0:shoulder_pan_joint",
        "robot0:shoulder_lift_joint",
        "robot0:upperarm_roll_joint",
        "robot0:elbow_flex_joint",
        "robot0:forearm_roll_joint",
        "robot0:wrist_flex_joint",
        "robot0:wrist_roll_joint",
    ),
    finger_joints=("robot0:r_gripper_finger_joint", "robot0:l_gripper_finger_joint"),
    hand_body="robot0:gripper_link",
    grip_site="robot0:grip",
    base_body="robot0:base_link",
    owners={"robot0:*gripper*": "gripper0", "robot0:*": "robot0"},
)
SUITE = Suite("fetch_table", budget=50, benchmark="fetch", label="table", tasks=2)
"""The budget is Fetch's own limit of steps."""

SPARES = tuple(f"box_{number}" for number in range(1, 6))
"""Boxes that are out of the scene until an event brings them in: distractors and obstacles."""
TASKS = ("pick_and_place", "push")
LANGUAGE = "move the block to the red ball"
_EVENTS = (
    "illumination_switch",
    "camera_shift",
    "visual_theme_switch",
    "sensor_noise_onset",
    "target_relocation",
    "receptacle_relocation",
    "distractor_burst",
    "obstacle_insertion",
)


def task(index: int) -> TaskMetadata:
    """Return what the scene of a task contains. The ball can be moved, so it counts as an object."""
    on_table = InitialPlacement("On", "table", "table")
    return TaskMetadata(
        name=TASKS[index],
        language=LANGUAGE,
        objects={"block": "block", "ball": "ball", **dict.fromkeys(SPARES, "box")},
        fixtures={"table": "table"},
        objects_of_interest=frozenset({"block", "ball"}),
        goal=(Relation("At", ("block", "ball")),),
        placements=dict.fromkeys(("block", "ball", *SPARES), on_table),
        parked=frozenset(SPARES),
        camera=FETCH.cameras[0],
    )


def cases(inits: Sequence[int] = (0,), variants: Sequence[int] = (0, 1)) -> list[Case]:
    """Return the cases of all events in both tasks."""
    return [
        make_case(event, SUITE.name, index, init, variant=variant)
        for index, init, event, variant in product(range(len(TASKS)), inits, _EVENTS, variants)
    ]


def _open(options: SubstrateOptions) -> Substrate:
    from fetch_scene import FetchSubstrate  # type: ignore[import-not-found]

    substrate: Substrate = FetchSubstrate()
    return substrate


def _lacking(options: SubstrateOptions, wanted: Sequence[Case]) -> Mapping[str, str]:
    lacking = find_spec("gymnasium_robotics") is None
    return {case.case_id: "gymnasium-robotics is not installed" for case in wanted if lacking}


KIND = SubstrateKind(
    "fetch",
    _open,
    lacking=_lacking,
    suites=(SUITE.name,),
    contents=lambda suite, index: task(index),
    tracks=lambda options: Tracks("fetch", per_event={"smoke": 2}),
    examples=lambda options: cases(),
    control_hz=FETCH.control_hz,
    note="Measured on Fetch of gymnasium-robotics.",
)


class Scripted:
    """Picks the block up, or pushes it, by what an observation holds: it has no memory."""

    spec = PolicySpec("fetch-scripted", horizon=4, query_interval=4, cameras=(), robot=FETCH.name)

    def reset(self, episode: Episode) -> None:
        self._pushes = TASKS[episode.task_index] == "push"

    def predict(self, observation: Mapping[str, Array], query: Query) -> Array:
        hand, block = observation["observation"][:3], observation["achieved_goal"]
        goal, opening_m = observation["desired_goal"], float(observation["fingers"].sum())
        place, grip = _push(hand, block, goal) if self._pushes else _pick(hand, block, goal, opening_m)
        way = np.clip(_GAIN * (place - hand), -1.0, 1.0)
        return np.tile([*way, grip], (4, 1))


_GAIN = 10.0
_ABOVE_M = np.array([0.0, 0.0, 0.08])
_HELD_M = 0.052
"""Opening of the fingers with the block between them, which is 5 cm wide."""


def _pick(hand: Array, block: Array, goal: Array, opening_m: float) -> tuple[Array, float]:
    """Return where the hand goes next, and the command of the gripper."""
    aside, height = np.linalg.norm((block - hand)[:2]), hand[2] - block[2]
    if aside > 0.02 and height < 0.06:
        return hand + _ABOVE_M, 1.0
    if aside > 0.01 and height > 0.02:
        return block + _ABOVE_M, 1.0
    if height > 0.01:
        return block, 1.0
    if opening_m > _HELD_M:
        return hand, -1.0
    return goal + hand - block, -1.0


def _push(hand: Array, block: Array, goal: Array) -> tuple[Array, float]:
    """Likewise, where the gripper is blocked: behind the block, then towards the goal."""
    ahead = (goal - block)[:2] / max(float(np.linalg.norm((goal - block)[:2])), 1e-6)
    way = (hand - block)[:2]
    along, aside = float(way @ ahead), float(np.linalg.norm(way - (way @ ahead) * ahead))
    if along < 0.0 and aside < 0.02 and hand[2] < block[2] + 0.03:
        return np.array([*(goal[:2] - 0.05 * ahead), block[2]]), 0.0
    behind = np.array([*(block[:2] - 0.09 * ahead), block[2]])
    if np.linalg.norm((behind - hand)[:2]) < 0.02:
        return behind, 0.0
    if hand[2] < block[2] + 0.07:
        return hand + _ABOVE_M, 0.0
    return behind + _ABOVE_M, 0.0


if __name__ == "__main__":
    sys.stdout.write(Manifest.of("fetch", cases()).to_json())
