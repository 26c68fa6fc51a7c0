"""The pair runner on a scene with a robot; the tiny world stands in for it everywhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pytest_libero_max.benchmark.manifests import parse_manifest
from pytest_libero_max.benchmark.tracks import load_track
from pytest_libero_max.events.registry import check_cases
from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.substrates.embedded.substrate import EmbeddedSubstrate

from .actors import make_case


@pytest.mark.parametrize("event", ["camera_shift", "sensor_noise_onset"])
def test_fork_and_replay_measure_the_same_pair_with_images_at_every_query(event: str) -> None:
    case = make_case(event, distance_m=0.35, suite="libero_object")
    trigger = {**case.event.trigger, "value": "alphabet_soup_1"}
    case = replace(case, event=replace(case.event, trigger=trigger))
    policy = load_policy("random")
    policy.spec = replace(policy.spec, image_size=64)
    substrate = EmbeddedSubstrate()
    world = substrate.world(case)
    fork, replay = (measure_pair(case, world, policy, PairSettings(mode)) for mode in ("fork", "replay"))
    substrate.close()
    assert fork.record.identity() == replay.record.identity()
    assert fork.record.trigger_step is not None
    assert fork.record.evidence is not None
    assert fork.record.evidence["pixel_change"]["agentview"] > 1.0
    assert fork.dynamic is not None
    # The policy ignores what it sees and both events leave the physics alone: only the proof may differ.
    assert np.array_equal(fork.dynamic.end_effector, fork.base.end_effector)
    assert fork.record.dynamic_digest != fork.record.base_digest


SWITCH = {
    "operation": "set_task",
    "instruction": "pick up the tomato sauce and place it in the basket",
    "goal": [["in", "tomato_sauce_1", "basket_1_contain_region"]],
}
PROGRAM = {
    "name": "many",
    "arms": [
        {
            "name": "dynamic",
            "schedule": [
                {"trigger": "event", "change": "event"},
                {"trigger": {"type": "steps_after", "steps": 5}, "reverts": 0},
            ],
        },
        {"name": "reset", "schedule": [{"trigger": {"type": "at_start"}, "change": "event"}]},
        {
            "name": "later",
            "schedule": [
                {"trigger": {"type": "after_grasp", "value": {"event": "value"}}, "change": "event"},
            ],
        },
        {"name": "switched", "schedule": [{"trigger": "event", "change": SWITCH}]},
    ],
}


def test_a_manifest_with_a_program_plays_transient_reset_later_and_switched_arms() -> None:
    first = next(
        case
        for case in load_track("original")
        if (case.suite, case.event.name) == ("libero_object", "camera_shift")
    )
    (case,) = parse_manifest(
        {
            "benchmark_id": "many",
            "benchmark_version": "1.0.0",
            "protocol": load_track("original").protocol,
            "manifest_format": 2,
            "cases": [{**first.record, "program": PROGRAM}],
        }
    )
    check_cases([case])
    substrate = EmbeddedSubstrate()
    world = substrate.world(case)
    pair = measure_pair(case, world, load_policy("expert"))
    substrate.close()
    arms = pair.record.arms
    assert list(arms) == ["base", "dynamic", "reset", "later", "switched"]
    event, back = arms["dynamic"].firings
    assert back.step == event.step + 5
    assert arms["reset"].firings[0].step == 0
    assert arms["later"].firings[0].step > back.step  # the grasp is after the approach
    assert arms["later"].firings[0].evidence["before"] == event.evidence["before"]
    assert arms["base"].success
    assert not arms["switched"].success or arms["switched"].steps != arms["base"].steps
    assert arms["switched"].firings[0].evidence["after"]["goal"] == SWITCH["goal"]
