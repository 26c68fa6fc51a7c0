"""The probes of every pair, which cost little. The columns of those here are fields of the record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pytest_libero_max.pairing.probes.probe import Column, Probe, Probes, View
from pytest_libero_max.pairing.probes.stages import Stages


class Approach(Probe[None]):
    """Closest distance of the end effector to the trigger entity."""

    name = "approach"
    schema = (
        Column(
            "min_distance_m",
            "float",
            "Smallest distance of the end effector to the case's trigger entity",
            "m",
            optional=True,
        ),
    )
    cost = "nothing a step"
    every = "end"

    def columns(self, state: None, view: View) -> Mapping[str, Any]:
        """Return the smallest distance after a step; None where none was executed."""
        return {"min_distance_m": min((step.distance_m for step in view.trajectory.executed), default=None)}


class Clipping(Probe[None]):
    """Actions beyond the range that the controller executes."""

    name = "clipping"
    schema = (
        Column(
            "clipped_components",
            "int",
            "Number of the 7 * steps components of the executed actions beyond +-1, which the controller "
            "clips; under absolute control of those of the gripper",
        ),
    )
    cost = "nothing a step"
    every = "end"

    def columns(self, state: None, view: View) -> Mapping[str, Any]:
        """Return the number over all steps."""
        executed = view.trajectory.actions
        clipped = executed if view.control == "delta" or not executed.size else executed[:, -1]
        return {"clipped_components": int((np.abs(clipped) > 1.0).sum())}


class Contacts(Probe[None]):
    """Contacts of the trigger entity at the end."""

    name = "contacts"
    schema = (Column("contacts", "str", "Names of what touches the trigger entity then", many=True),)
    cost = "one look at the contacts, 0.05 ms an arm"
    every = "end"

    def columns(self, state: None, view: View) -> Mapping[str, Any]:
        """Return the names, sorted."""
        return {"contacts": view.world.contacts(view.entity)}


class Response(Probe[None]):
    """Delay between the first event and the policy's next query."""

    name = "response"
    schema = (
        Column(
            "response_step",
            "int",
            "Policy steps executed at the first query after the first firing",
            "steps",
            optional=True,
        ),
        Column(
            "stale_actions",
            "int",
            "Number of queued actions executed after the first firing and before that query, or with latency "
            "before its answer is there; all later ones where no query followed",
            "steps",
            optional=True,
        ),
    )
    cost = "nothing a step"
    every = "end"

    def columns(self, state: None, view: View) -> Mapping[str, Any]:
        """Return both columns; None where nothing happened, and no response where no query followed."""
        trajectory = view.trajectory
        if not trajectory.firings:
            return {"response_step": None, "stale_actions": None}
        event = trajectory.firings[0]
        after = (query for query in trajectory.queries[event.queries :] if query.is_asked)
        response, last = next(after, None), trajectory.step
        if response is None:
            return {"response_step": None, "stale_actions": last - event.step}
        last = min(last, response.step + trajectory.latency_of(response.index).delay(response.index))
        return {"response_step": response.step, "stale_actions": last - event.step}


STANDARD = Probes((Approach(), Clipping(), Contacts(), Response(), Stages()))
"""The probes of every pair."""
