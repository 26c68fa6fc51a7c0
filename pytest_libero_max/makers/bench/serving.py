"""Queries by the second: what one policy server gives to several clients that ask at once."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.makers.bench.clock import in_processes, wait_for_others
from pytest_libero_max.policies.clients.opening import load_served
from pytest_libero_max.policies.contract import Episode, Policy, PolicySpec, Query
from pytest_libero_max.policies.loading import load_policy
from pytest_libero_max.policies.server.batching import Batching
from pytest_libero_max.policies.server.host import Host
from pytest_libero_max.policies.server.sockets import serving
from pytest_libero_max.worlds.contract import Observation, height_and_width
from pytest_libero_max.worlds.robot import ACTION_DIM

_WARM_UP = 5
_EPISODE = Episode("libero_spatial", 0, "pick up the bowl", 7, 220)
_STATE = {"eef_pos": 3, "eef_quat": 4, "gripper_qpos": 2, "gripper_qvel": 2, "joint_pos": 7, "joint_vel": 7}


@dataclass(frozen=True)
class ServingRate:
    """Queries that one server answered."""

    clients: int
    """Number of processes that asked at once, each as soon as it was answered."""
    queries: int
    seconds: float
    median_ms: float
    """Median time of a query in its client."""
    p99_ms: float
    """The 99th percentile of it."""


class Zeros:
    """Policy that answers at once with ten actions of zeros: what remains is the way to a server and back."""

    spec = PolicySpec("zeros", horizon=10, query_interval=10)

    def reset(self, episode: Episode) -> None:
        """Begin an episode."""

    def predict(self, observation: Observation, query: Query) -> NDArray[np.float64]:
        return np.zeros((10, ACTION_DIM))


def measure_serving(
    reference: str | None, clients: Sequence[int], *, seconds: float = 5.0
) -> Iterator[ServingRate]:
    """Serve a policy in this process, and measure it with each number of clients, one after the other.

    Queries have images of noise, which nothing could compress, in the policy's own sizes.

    Args:
        reference: Policy to serve, as for ``--libero-max-policy``; None: :class:`Zeros`.
        seconds: Time to ask for, each.
    """
    policy: Policy = Zeros() if reference is None else load_policy(reference)
    batching = Batching(max(clients)) if hasattr(policy, "predict_batch") else Batching()
    with serving(Host(policy, "bench", batching), port=0) as (port, _):
        for number in clients:
            address = f"openpi://127.0.0.1:{port}"
            times = np.concatenate(in_processes(number, _ask, address, policy.spec, seconds))
            median, p99 = 1e3 * np.quantile(times, (0.5, 0.99))
            yield ServingRate(number, times.size, seconds, float(median), float(p99))


def _ask(address: str, spec: PolicySpec, seconds: float) -> NDArray[np.float64]:
    """Ask as fast as answers come; returns the seconds of each query."""
    policy = load_served(address, "served")
    policy.reset(_EPISODE)
    random = np.random.default_rng(0)
    shape = (*height_and_width(spec.image_size), 3)
    observation: dict[str, NDArray[np.generic]] = {
        f"{camera}_image": random.integers(0, 256, shape, np.uint8) for camera in spec.cameras
    }
    observation |= {f"robot0_{name}": np.zeros(length) for name, length in _STATE.items()}
    query = Query(0, 0, _EPISODE.instruction, 0)
    for _ in range(_WARM_UP):
        policy.predict(observation, query)
    wait_for_others()
    times, end = [], time.perf_counter() + seconds
    while (begin := time.perf_counter()) < end:
        policy.predict(observation, query)
        times.append(time.perf_counter() - begin)
    return np.array(times)


def serving_lines(rates: Sequence[ServingRate]) -> list[str]:
    """Return a table in Markdown."""
    return [
        "| clients | queries/s, all | median, ms | 99 %, ms |",
        "| ---: | ---: | ---: | ---: |",
        *(
            f"| {rate.clients} | {rate.queries / rate.seconds:.0f} | {rate.median_ms:.1f} "
            f"| {rate.p99_ms:.1f} |"
            for rate in rates
        ),
    ]
