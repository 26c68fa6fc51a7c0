"""How many actors have room in a cluster."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

_ROUNDING = 1e-9
"""0.3 / 0.1 is a little less than 3."""


def seats(nodes: Iterable[Mapping[str, Any]], cpus: float, gpus: float) -> int:
    """How many actors have room on the living nodes, whatever else runs there.

    Args:
        nodes: As ``ray.nodes()`` lists them.
        cpus: Of an actor.
        gpus: Of an actor. A fraction lies on one GPU.
    """
    return sum(seats_of(node.get("Resources", {}), cpus, gpus) for node in nodes if node.get("Alive"))


def seats_of(resources: Mapping[str, float], cpus: float, gpus: float) -> int:
    """How many actors have room on one node with these resources."""
    rooms = []
    if cpus:
        rooms.append(int(resources.get("CPU", 0) / cpus + _ROUNDING))
    if gpus:
        there = resources.get("GPU", 0)
        on_each = int(1 / gpus + _ROUNDING)
        rooms.append(int(there) * on_each if gpus < 1 else int(there / gpus + _ROUNDING))
    return min(rooms, default=0)
