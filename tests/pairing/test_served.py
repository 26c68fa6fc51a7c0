"""Pairs of a policy behind `libero-max serve` are those of the same policy in process."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_libero_max.pairing.runner import PairSettings, measure_pair
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import PolicySpec
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.substrates.tiny.world import TinyWorld

from .actors import make_case


class Smooth:
    """Moves on from what it did before: its memory decides what it does after the event."""

    def __init__(self) -> None:
        self.spec = PolicySpec("smooth", 4, 2, cameras=(), revision="1")
        self.memory = np.zeros(7)

    def reset(self, episode: Any) -> None:
        self.memory = np.zeros(7)

    def predict(self, observation: Any, query: Any) -> Any:
        goal = np.clip((np.array([0.1, -0.1, 0.5]) - observation["robot0_eef_pos"]) / 0.1, -1, 1)
        self.memory[:3] += 0.3 * (goal - self.memory[:3])
        return np.tile(self.memory, (4, 1))

    def snapshot(self) -> Any:
        return self.memory.copy()

    def restore(self, memory: Any) -> None:
        self.memory = memory.copy()


def test_a_memory_kept_by_a_server_crosses_the_event() -> None:
    world = TinyWorld()
    case = make_case(distance_m=0.3)
    records = []
    with serving(Host(Smooth(), "x"), port=0) as (port, _):
        served = load_served(f"openpi://127.0.0.1:{port}", "served")
        for policy in (Smooth(), served):
            for how in ("fork", "replay"):
                records.append(measure_pair(case, world, policy, PairSettings(how)).record)
        served.client.close()
    world.close()
    assert records[0].triggered
    assert {arm.returned for record in records[:2] for arm in record.arms.values()} == {None}
    assert {arm.returned for record in records[2:] for arm in record.arms.values()} == {(4, 4)}
    assert len({str(record.identity()) for record in records}) == 1
    assert "server_batch" not in records[2].timings


def test_the_largest_batch_of_a_pair_is_noted() -> None:
    class Together(Smooth):
        batch_size = 1

        def predict(self, observation: Any, query: Any) -> Any:
            self.batch_size = (1, 3, 2)[query.index % 3]
            return super().predict(observation, query)

    world = TinyWorld()
    record = measure_pair(make_case(), world, Together()).record
    world.close()
    assert record.timings["server_batch"] == 3
