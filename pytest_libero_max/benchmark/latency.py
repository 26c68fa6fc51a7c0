"""Latency (inference delay): control steps that an answer of the policy takes, while the world goes on."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

Runner = Literal["async", "sync"]
"""Behaviour until the answer is there. ``async`` (asynchronous inference): the policy is asked every Q steps,
and the robot goes on with the chunk before, beyond Q too; as many actions as it executes of it meanwhile are
dropped from the beginning of the new one. ``sync`` (synchronous, blocking inference): the policy is asked
when Q actions are executed, and the robot waits, and executes the new chunk from its beginning."""

MOST_STEPS = 999

PATTERN = r"^[1-9][0-9]{0,2}steps(,sync)?$(?!\n)"
"""Text of a latency in headers, records and programs."""


@dataclass(frozen=True)
class Latency:
    """Time that a query takes.

    Attributes:
        steps: d, the control steps from an observation to the first action that may follow from it. At 0 the
            world waits for the policy.
        runner: Behaviour of the robot until the answer is there. Of no meaning at 0 steps.
    """

    steps: int = 0
    runner: Runner = "async"

    def __str__(self) -> str:
        """Return ``4steps`` or ``4steps,sync``; :meth:`parse` reads it."""
        return f"{self.steps}steps" + (",sync" if self.runner == "sync" else "")

    @classmethod
    def parse(cls, text: str, hz: int | None = None) -> Latency:
        """Read ``4steps``, with ``,sync`` behind it for the blocking runner.

        Args:
            text: The text.
            hz: Control steps a second. Then ``200ms`` is read as well, rounded up to whole steps: an answer
                that is there between two steps is used at the later one. None: it is not.

        Raises:
            ValueError: It has another form; says which is expected.
        """
        amount, _, runner = text.partition(",")
        units = "steps" if hz is None else "steps|ms"
        match = re.fullmatch(rf"([0-9]{{1,9}})({units})", amount)
        if match is None or runner not in ("", *get_args(Runner)):
            example = "4steps" if hz is None else "200ms or 4steps"
            raise ValueError(f"expected a whole number with its unit, for example {example}, or 4steps,sync")
        number = int(match[1])
        steps = number if match[2] == "steps" or hz is None else -(-number * hz // 1000)
        if steps > MOST_STEPS:
            raise ValueError(f"{steps} steps, but expected at most {MOST_STEPS}")
        return cls(steps, "sync" if runner == "sync" else "async") if steps else NO_LATENCY

    def interval(self, query_interval: int) -> int:
        """Return the steps from one query to the next.

        Args:
            query_interval: Q. An asynchronous runner asks every Q steps, but not before it has the answer to
                the query before.
        """
        return query_interval + self.steps if self.runner == "sync" else max(query_interval, self.steps)


NO_LATENCY = Latency()
"""The world waits for the policy, as in every evaluation that steps its simulator only between queries."""
