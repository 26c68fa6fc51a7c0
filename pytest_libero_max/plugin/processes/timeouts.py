"""The wall-clock limits of a run."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """The longest that each may take, s on the wall clock; None: for ever.

    Attributes:
        query: A call of the policy.
        step: Work of the simulator between two calls of the watch: a step, a reset, images.
        pair: All arms of a pair. The loading of the policy is not part of it.
    """

    query: float | None = None
    step: float | None = None
    pair: float | None = None
