"""Actions of the policies that ship with the package, in a few scenes, and the file that keeps their digests.

A policy that acts otherwise is another policy. Raise its version in its module (``VERSION``),
then write the file again:

    python -m tests.experts.golden_actions

Each line of MuJoCo has a file. Components are rounded to a thousandth, far above what kinds of processors
differ in. ``servo`` is shown a picture that is kept beside the file, because renderers differ in more.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import cv2
import numpy as np

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events.new_case import make_case
from pytest_libero_max.events.schedules import arms_of
from pytest_libero_max.pairing.runner import measure_pair
from pytest_libero_max.policies.contract import Episode, Query, query_seed
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.policies.references import parse_reference, shipped_names, shipped_version
from pytest_libero_max.substrates.contract import Substrate, SubstrateOptions
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate
from pytest_libero_max.substrates.registry import open_substrate
from pytest_libero_max.worlds.contract import Array
from tests.mujoco_line import LINE

FILE = Path(__file__).with_name("golden_actions.json" if LINE == "3.3" else f"golden_actions_{LINE}.json")
PICTURE = Path(__file__).with_name("golden_view.png")

WORLDS = MappingProxyType({"metaworld-expert": "metaworld", "robosuite-expert": "robosuite"})
"""Substrates of the policies that play other tasks than LIBERO's: the first case of each suite in the smoke
track."""

SCENES = (
    ("libero_spatial", 0, "target_relocation"),
    ("libero_object", 7, "receptacle_relocation"),
    ("libero_goal", 0, "illumination_switch"),  # a drawer
    ("libero_goal", 7, "illumination_switch"),  # a knob
)
SERVO_SCENE = ("libero_spatial", 3, 7)
STEP_M = 0.05
CAMERA, IMAGE_SIZE = "agentview", 256


def actions_of(name: str, substrate: EmbeddedSubstrate) -> dict[str, str]:
    """Number and digest of a policy's actions, by what it was shown."""
    if name in WORLDS:
        return _actions_elsewhere(name, WORLDS[name])
    shown: dict[str, Callable[[], Sequence[Array]]]
    if name in ("expert", "stale_expert"):
        shown = {
            f"{suite}/{task}, {event}": partial(_played, name, suite, task, event, substrate)
            for suite, task, event in SCENES
        }
    else:
        shown = {"the picture": partial(_shown_the_picture, name)}
    return {scene: _told(actions()) for scene, actions in shown.items()}


def _actions_elsewhere(name: str, world: str) -> dict[str, str]:
    cases = {case.suite: case for case in reversed(load_track(f"{world}/smoke").cases)}
    substrate = open_substrate(world, SubstrateOptions())
    try:
        return {suite: _told(_pair(name, cases[suite], substrate)) for suite in sorted(cases)}
    finally:
        substrate.close()


def _told(actions: Sequence[Array]) -> str:
    rounded = np.round(np.asarray(actions, dtype=np.float64), 3) + 0.0  # no negative zero
    return f"{len(rounded)} actions {hashlib.sha256(rounded.tobytes()).hexdigest()[:16]}"


def _played(name: str, suite: str, task: int, event: str, substrate: EmbeddedSubstrate) -> Sequence[Array]:
    return _pair(name, make_case(event, suite, task), substrate)


def _pair(name: str, case: Case, substrate: Substrate) -> Sequence[Array]:
    """The actions of Base, and then those of Dynamic."""
    policy = load_policy(name)
    policy.spec = replace(policy.spec, cameras=())
    pair = measure_pair(case, substrate.world(case), policy, arms=arms_of(case))
    return [action for rollout in pair.rollouts.values() for action in rollout.trajectory.actions]


def _shown_the_picture(name: str) -> Sequence[Array]:
    """The actions of a policy that is shown one picture, with a hand that goes where it is sent."""
    policy = load_policy(name)
    instruction = "pick up the black bowl on the cookie box and place it on the plate"
    policy.reset(Episode("libero_spatial", 3, instruction, 195, 220, world=None))
    stored = cv2.imread(str(PICTURE))
    assert stored is not None, PICTURE
    picture = stored[:, :, ::-1]
    position, opening, executed = np.array([-0.2, 0.0, 1.17]), 0.04, []
    for index in range(24):
        observation: dict[str, Any] = {
            f"{CAMERA}_image": picture,
            "robot0_eye_in_hand_image": picture,
            "robot0_eef_pos": position.copy(),
            "robot0_eef_quat": np.array([1.0, 0.0, 0.0, 0.0]),
            "robot0_gripper_qpos": np.array([opening, -opening]),
        }
        query = Query(index, 5 * index, instruction, query_seed(195, index))
        for action in policy.predict(observation, query)[:5]:
            executed.append(action)
            position = position + STEP_M * np.clip(action[:3], -1.0, 1.0) / 4
            opening = float(np.clip(opening - 0.01 * np.sign(action[6]), 0.01, 0.04))
    return executed


def golden() -> Any:
    """The content of the file."""
    return json.loads(FILE.read_text())


def _take_picture(substrate: EmbeddedSubstrate) -> None:
    suite, task, init = SERVO_SCENE
    world = substrate.world(make_case("illumination_switch", suite, task, init))
    world.reset(init)
    image = world.observe((CAMERA,), IMAGE_SIZE)[f"{CAMERA}_image"]
    cv2.imwrite(str(PICTURE), image[:, :, ::-1])


if __name__ == "__main__":
    substrate = EmbeddedSubstrate()
    if not PICTURE.exists():
        _take_picture(substrate)
    content = {
        name: {
            "version": shipped_version(parse_reference(name)),
            "actions": actions_of(name, substrate),
        }
        for name in shipped_names()
    }
    substrate.close()
    FILE.write_text(json.dumps(content, indent=1) + "\n")
    print(f"Wrote {FILE}.")
