"""Measurements for the evidence of several changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from pytest_libero_max.worlds.contract import AlterableWorld, PixelFilter


def filter_records(world: AlterableWorld) -> list[dict[str, Any]]:
    """Return the world's active pixel filters as JSON values, in the order in which they act."""
    return [filter_record(pixel_filter, since) for pixel_filter, since in world.filters]


def filter_record(pixel_filter: PixelFilter, since: int) -> dict[str, Any]:
    """Return a pixel filter and the step at which it was added, as JSON values."""
    value: Any = pixel_filter
    fields = dataclasses.fields(value) if dataclasses.is_dataclass(value) else ()
    values = {field.name: getattr(value, field.name) for field in fields if field.repr}
    parameters = {name: list(v) if isinstance(v, tuple) else v for name, v in values.items()}
    return {"filter": type(pixel_filter).__name__, "since_step": since, **parameters}


def measure_poses(world: AlterableWorld, names: Iterable[str]) -> dict[str, Any]:
    """Return the positions of the entities named, for the evidence."""
    poses = {name: world.pose(name) for name in names}
    return {
        "position_m": {name: [float(v) for v in position] for name, (position, _) in poses.items()},
        "quaternion_wxyz": {name: [float(v) for v in quaternion] for name, (_, quaternion) in poses.items()},
        "taken_out": [name for name in poses if name in world.parked],
    }
