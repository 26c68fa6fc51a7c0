"""Several pairs in step under one batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.pairing.runner import PairSettings, measure_in_step, measure_pair
from pytest_libero_max.policies.contract import BatchItem
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import BUDGET, Approaching, make_case


class Together(Approaching):
    """Answers several queries together; counts how many each time."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.sizes: list[int] = []

    def predict_batch(self, items: Sequence[BatchItem]) -> list[NDArray[np.float64]]:
        self.sizes.append(len(items))
        assert all(item.episode.max_steps == BUDGET for item in items)
        return [super(Together, self).predict(item.observation, item.query) for item in items]


@pytest.fixture
def worlds() -> Iterator[list[TinyWorld]]:
    worlds = [TinyWorld() for _ in range(3)]
    yield worlds
    for world in worlds:
        world.close()


@pytest.mark.parametrize("mode", ["fork", "replay"])
def test_pairs_in_step_are_those_that_are_played_one_by_one(worlds: list[TinyWorld], mode: Any) -> None:
    cases = [make_case(event) for event in ("target_relocation", "camera_shift", "sensor_noise_onset")]
    policy, settings = Together(wait=3, horizon=6, interval=4, cameras=("agentview",)), PairSettings(mode)
    together = measure_in_step(list(zip(cases, worlds, strict=True)), policy, settings)
    alone = [measure_pair(case, worlds[0], policy, settings) for case in cases]
    assert [pair.record.identity() for pair in together] == [pair.record.identity() for pair in alone]
    assert all(pair.record.triggered for pair in together)
    assert max(policy.sizes) == 3


def test_pairs_that_end_early_leave_the_batch(worlds: list[TinyWorld]) -> None:
    policy = Together(wait=BUDGET, horizon=5, interval=5)
    cases = [make_case(distance_m=9.0), make_case(), make_case()]
    pairs = measure_in_step(list(zip(cases, worlds, strict=True)), policy)
    assert [pair.record.triggered for pair in pairs] == [True, False, False]
    assert policy.sizes == [3] * 5 + [1] * (len(policy.sizes) - 5)


def test_what_cannot_be_asked_together_is_refused(worlds: list[TinyWorld]) -> None:
    case = make_case()
    with pytest.raises(AdapterError, match="predict_batch"):
        measure_in_step([(case, worlds[0])], Approaching())
    with pytest.raises(AdapterError, match="have one world"):
        measure_in_step([(case, worlds[0]), (case, worlds[0])], Together())


def test_an_error_of_the_batch_leaves_every_scene_as_it_was_built(worlds: list[TinyWorld]) -> None:
    class Failing(Together):
        def predict_batch(self, items: Any) -> Any:
            worlds[1].model.opt.gravity[2] = -1.0
            raise ValueError("out of memory")

    case = make_case()
    with pytest.raises(AdapterError, match="out of memory"):
        measure_in_step([(case, world) for world in worlds], Failing())
    assert worlds[1].model.opt.gravity[2] == pytest.approx(-9.81)
