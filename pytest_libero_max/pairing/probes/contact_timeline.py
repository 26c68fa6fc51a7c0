"""Contacts of the trigger entity over a whole arm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pytest_libero_max.pairing.probes.probe import Column, Probe, View

Contacts = tuple[tuple[int, str], ...]


class ContactTimeline(Probe[Contacts]):
    """Contacts of the trigger entity over the whole arm, an entry for each change.

    It shows whether the hand ever touched the entity, when it let go, and the support at the end.
    """

    name = "contact_timeline"
    schema = (
        Column("step", "int", "Policy steps executed at each change, 0 first", "steps", many=True, least=0),
        Column(
            "touching",
            "str",
            "Names of what touched the trigger entity from then on, with spaces between them",
            many=True,
            along="step",
        ),
    )
    cost = "one look at the contacts, 0.05 ms a step"

    def start(self, view: View) -> Contacts:
        """Return the contacts at the start."""
        return ((0, self._touching(view)),)

    def step(self, state: Contacts, view: View) -> Contacts:
        """Return one entry more where the contacts have changed."""
        touching = self._touching(view)
        return state if touching == state[-1][1] else (*state, (view.trajectory.step, touching))

    def columns(self, state: Contacts, view: View) -> Mapping[str, Any]:
        """Return the entries as two lists of one length."""
        return {"step": [step for step, _ in state], "touching": [names for _, names in state]}

    def _touching(self, view: View) -> str:
        return " ".join(view.world.contacts(view.entity))
