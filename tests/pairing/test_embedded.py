"""The pair runner on a scene with a robot; the tiny world stands in for it everywhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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
