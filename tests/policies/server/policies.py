"""Policies to serve."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pytest_libero_max.policies.contract import BatchItem, PolicySpec
from tests.conformance.policies import Sound

SPEC = PolicySpec("served", 8, 4, image_size=256)


class Batched(Sound):
    """Answers in batches exactly as alone, and keeps the sizes."""

    def __init__(self) -> None:
        self.spec = SPEC
        self.sizes: list[int] = []

    def predict_batch(self, items: Sequence[BatchItem]) -> list[Any]:
        self.sizes.append(len(items))
        return [self.chunk(item.observation, item.query)[: self.spec.horizon] for item in items]


class Counting(Sound):
    """Remembers how many queries it has answered, and of which episode."""

    def __init__(self) -> None:
        self.spec = SPEC
        self.memory = (0, -1)

    def reset(self, episode: Any) -> None:
        self.memory = (0, episode.task_index)

    def predict(self, observation: Any, query: Any) -> Any:
        count, task = self.memory
        self.memory = (count + 1, task)
        actions = np.zeros((8, 7))
        actions[:, :2] = count / 100, task / 100
        return actions

    def snapshot(self) -> Any:
        return self.memory

    def restore(self, memory: Any) -> None:
        self.memory = memory


def at_once(*acts: Callable[[], Any]) -> list[Any]:
    """What the functions return, each called in a thread of its own."""
    results: list[Any] = [None] * len(acts)

    def run(number: int) -> None:
        results[number] = acts[number]()

    threads = [threading.Thread(target=run, args=(number,)) for number in range(len(acts))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    return results
