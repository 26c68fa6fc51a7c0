"""Latency (inference delay): control steps that an answer of the policy takes, while the world goes on."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal, get_args

Runner = Literal["async", "sync"]
"""Behaviour until the answer is there. ``async`` (asynchronous inference): the policy is asked every Q steps,
and the robot goes on with the chunk before, beyond Q too; as many actions as it executes of it meanwhile are
dropped from the beginning of the new one. ``sync`` (synchronous, blocking inference): the policy is asked
when Q actions are executed, and the robot waits, and executes the new chunk from its beginning."""

MOST_STEPS = 999

CHANGED_BY = "delay_answers"
"""Operation of the change with which answers begin to come late in the middle of an episode."""

_STEPS = "[1-9][0-9]{0,2}"
_DRAWN = rf"{_STEPS}:[1-9][0-9]{{0,8}}"

PATTERN = rf"^({_STEPS}|{_DRAWN}(\+{_DRAWN})*)steps(,sync)?$(?!\n)"
"""Text of a latency in headers, records and programs."""


@dataclass(frozen=True)
class Latency:
    """Time that a query takes."""

    steps: int = 0
    """D, the control steps from an observation to the first action that may follow from it; the most where
    they are drawn. At 0 the world waits for the policy."""
    runner: Runner = "async"
    """Behaviour of the robot until the answer is there. Of no meaning at 0 steps."""
    drawn: tuple[tuple[int, int], ...] = ()
    """Distribution of the delay of each query: values of d and their weights. Empty: it is ``steps``."""
    key: str = ""
    """Text that the draws follow from, set by :meth:`drawn_for`."""

    def __str__(self) -> str:
        """Return ``4steps``, ``4steps,sync`` or ``1:80+2:20steps``; :meth:`parse` reads it."""
        amount = "+".join(f"{steps}:{weight}" for steps, weight in self.drawn) or self.steps
        return f"{amount}steps" + (",sync" if self.runner == "sync" else "")

    @classmethod
    def of_times(cls, times_ms: Mapping[float, int], hz: int, runner: Runner = "async") -> Latency:
        """Return the latency of a server whose queries took so long.

        Args:
            times_ms: Numbers of queries by their time, ms. At least one.
            hz: Control steps a second. Times are rounded up to whole steps, of which there are at most 999.
        """
        weights: dict[int, int] = {}
        for time_ms, number in sorted(times_ms.items()):
            steps = min(max(math.ceil(time_ms * hz / 1000), 1), MOST_STEPS)
            weights[steps] = weights.get(steps, 0) + number
        return cls._of_weights(tuple(weights.items()), runner)

    @classmethod
    def _of_weights(cls, weights: tuple[tuple[int, int], ...], runner: Runner) -> Latency:
        return cls(weights[-1][0], runner, weights if len(weights) > 1 else ())

    @classmethod
    def parse(cls, text: str, hz: int | None = None) -> Latency:
        """Read ``4steps`` or ``1:80+2:20steps``, with ``,sync`` behind it for the blocking runner.

        Args:
            hz: Control steps a second. Then ``200ms`` is read as well, rounded up to whole steps: an answer
                that is there between two steps is used at the later one. None: it is not.

        Raises:
            ValueError: It has another form; says which is expected.
        """
        amount, _, runner = text.partition(",")
        units = "steps" if hz is None else "steps|ms"
        match = re.fullmatch(rf"([0-9]{{1,9}})({units})", amount)
        if runner in ("", *get_args(Runner)) and re.fullmatch(rf"{_DRAWN}(\+{_DRAWN})*steps", amount):
            return cls._parse_drawn(amount.removesuffix("steps"), "sync" if runner == "sync" else "async")
        if match is None or runner not in ("", *get_args(Runner)):
            example = "4steps" if hz is None else "200ms or 4steps"
            raise ValueError(f"expected a whole number with its unit, for example {example}, or 4steps,sync")
        number = int(match[1])
        steps = number if match[2] == "steps" or hz is None else -(-number * hz // 1000)
        if steps > MOST_STEPS:
            raise ValueError(f"{steps} steps, but expected at most {MOST_STEPS}")
        return cls(steps, "sync" if runner == "sync" else "async") if steps else NO_LATENCY

    @classmethod
    def _parse_drawn(cls, amount: str, runner: Runner) -> Latency:
        parts = (part.partition(":") for part in amount.split("+"))
        weights = tuple((int(steps), int(weight)) for steps, _, weight in parts)
        values = [steps for steps, _ in weights]
        if values != sorted(set(values)):
            raise ValueError(f"{amount}steps, but expected each number of steps once, in ascending order")
        return cls._of_weights(weights, runner)

    @property
    def delays(self) -> tuple[int, ...]:
        """The values of d that a query may have, steps."""
        return tuple(steps for steps, _ in self.drawn) or (self.steps,)

    def drawn_for(self, case_id: str) -> Latency:
        """Return the latency with its draws for a case, the same in all of its arms."""
        return replace(self, key=case_id) if self.drawn else self

    def delay(self, index: int) -> int:
        """Return d of a query, steps: drawn from the case and the number of the query alone.

        Args:
            index: Number of the query in its episode, from 0.
        """
        if not self.drawn:
            return self.steps
        digest = hashlib.sha256(f"libero-max-latency|{self.key}|{index}".encode()).digest()
        number = int.from_bytes(digest[:8], "big") % sum(weight for _, weight in self.drawn)
        sums = accumulate(weight for _, weight in self.drawn)
        return next(steps for (steps, _), below in zip(self.drawn, sums, strict=True) if number < below)

    def interval(self, query_interval: int, index: int) -> int:
        """Return the steps from a query to the next one.

        Args:
            query_interval: Q. An asynchronous runner asks every Q steps, but not before it has the answer to
                the query before.
            index: Number of the query, from 0.
        """
        delay = self.delay(index)
        return query_interval + delay if self.runner == "sync" else max(query_interval, delay)


NO_LATENCY = Latency()
"""The world waits for the policy, as in every evaluation that steps its simulator only between queries."""
