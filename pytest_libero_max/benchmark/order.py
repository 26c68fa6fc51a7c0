"""Order of play: a declared value, recorded with the run and the same on every worker.

One process plays exactly in this order. Several processes begin pairs as they are handed out: with ``sorted``
each worker gets neighbours, which share a scene, so the order holds within a worker's part alone. With
``blocks`` or ``shuffled``, or with a stopping rule, pairs are handed out one by one: a worker of xdist holds
the pair that it plays and the next one, an actor on Ray the pair that it plays. A pair whose process died is
handed out next.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from pytest_libero_max.benchmark.cases import Case

SORTED_NAME = "sorted"
BLOCKS_NAME = "blocks"
SHUFFLED_NAME = "shuffled"

_STRATA: tuple[Callable[[Case], str], ...] = (lambda case: case.event.name, lambda case: case.suite)
"""Labels that a block balances, the most important first."""


@dataclass(frozen=True)
class Order:
    """An order in which the cases of a run are played. No result depends on it."""

    seed: int | None = None
    """Seed of a permutation in blocks. Every block has the same share of each event as the whole, and the
    cases of an event run through the suites in the same way, so every prefix is balanced. None: sorted by
    item id, which keeps the cases of a scene together."""
    balanced: bool = True
    """False for a permutation without blocks. Each of all permutations is equally likely over the seeds, so
    every prefix is a simple random sample of the cases."""

    @classmethod
    def parse(cls, text: str) -> Order:
        """Read ``sorted``, ``blocks:SEED`` or ``shuffled:SEED``, or raise ValueError."""
        name, _, seed = text.partition(":")
        if text == SORTED_NAME:
            return cls()
        if name in (BLOCKS_NAME, SHUFFLED_NAME) and seed.isascii() and seed.isdigit() and len(seed) < 19:
            return cls(int(seed), name == BLOCKS_NAME)
        raise ValueError(
            f"expected {SORTED_NAME}, {BLOCKS_NAME}:SEED or {SHUFFLED_NAME}:SEED, for example {BLOCKS_NAME}:7"
        )

    def __str__(self) -> str:
        if self.seed is None:
            return SORTED_NAME
        return f"{BLOCKS_NAME if self.balanced else SHUFFLED_NAME}:{self.seed}"

    def of(self, cases: Iterable[Case]) -> tuple[Case, ...]:
        """Return the cases in this order, whatever order they are given in."""
        if self.seed is None:
            return tuple(sorted(cases, key=lambda case: case.item_id))
        return tuple(self._interleaved(list(cases), _STRATA if self.balanced else ()))

    def _interleaved(self, cases: Sequence[Case], labels: Sequence[Callable[[Case], str]]) -> list[Case]:
        """Return the cases with each stratum of the first label spread evenly, and within it the next."""
        if not labels:
            return sorted(cases, key=lambda case: self._rank(case.case_id))
        strata: dict[str, list[Case]] = {}
        for case in cases:
            strata.setdefault(labels[0](case), []).append(case)
        blocks = max(map(len, strata.values()), default=0)
        placed = [
            ((2 * place + 1) * blocks // (2 * len(stratum)), self._rank(f"{case.case_id}|block"), case)
            for stratum in strata.values()
            for place, case in enumerate(self._interleaved(stratum, labels[1:]))
        ]
        return [case for _, _, case in sorted(placed, key=lambda entry: entry[:2])]

    def _rank(self, text: str) -> str:
        return hashlib.sha256(f"libero-max-order|{self.seed}|{text}".encode()).hexdigest()
