"""The goal with which an arm began, where a change has given it another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pytest_libero_max.pairing.probes.probe import Column, Probe, View
from pytest_libero_max.worlds.privileged import Fact, PrivilegedWorld


class FirstGoal(Probe[tuple[Fact, ...]]):
    """Score of an arm by the goal that it began with; success is by the goal that holds at its end."""

    name = "first_goal"
    schema = (
        Column("goal", "str", "Facts of the goal before the first step", many=True),
        Column(
            "held",
            "bool",
            "True if all of them hold at the end; null where a world does not tell",
            optional=True,
        ),
    )
    cost = "one look at the goal at the end of an arm"
    every = "end"

    def start(self, view: View) -> tuple[Fact, ...]:
        """Return the facts of the goal."""
        return view.world.goal if isinstance(view.world, PrivilegedWorld) else ()

    def columns(self, state: tuple[Fact, ...], view: View) -> Mapping[str, Any]:
        """Return the facts, and whether they hold."""
        world, held = view.world, None
        if isinstance(world, PrivilegedWorld) and state:
            held = all(world.holds(fact) for fact in state)
        return {"goal": [" ".join(fact.words()) for fact in state], "held": held}
