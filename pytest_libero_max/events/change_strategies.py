"""Hypothesis strategies for changes; :mod:`pytest_libero_max.strategies` offers them to users.

This module imports Hypothesis, so nothing that plays a pair may import it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.changes import (
    Change,
    MoveObject,
    RemoveObject,
    SetLighting,
    SetSensorCorruption,
    SetVisualTheme,
    ShiftCamera,
)
from pytest_libero_max.errors import OptionError, did_you_mean
from pytest_libero_max.worlds.contract import Entity
from pytest_libero_max.worlds.robot import CAMERAS

Entities = Mapping[str, Entity]

AT_ONCE = (
    "set_lighting",
    "shift_camera",
    "set_visual_theme",
    "set_sensor_corruption",
    "move_object",
    "remove_object",
)
"""Operations that a world can take right after a reset; the insertions need a removal before."""

SEEDS = st.integers(0, 2**32 - 1)


def strengths() -> SearchStrategy[float]:
    """Strengths of a change: 0 to 1, both ends often."""
    return st.sampled_from([0.0, 0.25, 0.5, 1.0]) | st.floats(0.0, 1.0)


def changes(
    entities: Entities | None = None,
    *,
    operations: Iterable[str] = AT_ONCE,
    cameras: Iterable[str] = CAMERAS,
) -> SearchStrategy[Change]:
    """Return changes that a world with these entities can take right after a reset, or raise OptionError.

    Args:
        entities: The world's entities; by default those of the tiny world.
        operations: Operations of :data:`AT_ONCE` to draw from.
    """
    known = entities_or_tiny(entities)
    strategies: dict[str, Callable[[], SearchStrategy[Any]]] = {
        "set_lighting": lambda: st.builds(SetLighting, scale=st.floats(0.1, 2.0)),
        "shift_camera": lambda: st.builds(
            ShiftCamera,
            camera=st.sampled_from(sorted(cameras)),
            delta_position_m=vectors(0.1),
            yaw_degrees=st.floats(-45.0, 45.0),
            delta_fovy_degrees=st.floats(-15.0, 15.0),
        ),
        "set_visual_theme": lambda: st.builds(
            SetVisualTheme,
            rgb_permutation=st.permutations([0, 1, 2]).map(tuple),
            rgb_multiplier=st.tuples(*[st.floats(0.5, 1.5)] * 3),
        ),
        "set_sensor_corruption": lambda: st.builds(
            SetSensorCorruption,
            noise_std=st.floats(1.0, 40.0),
            occlusion_fraction=st.floats(0.0, 0.3),
            seed=SEEDS,
        ),
        "move_object": lambda: st.builds(
            MoveObject,
            object=st.sampled_from([name for name, entity in known.items() if entity.kind != "surface"]),
            delta_position_m=vectors(0.12, plane=True),
        ),
        "remove_object": lambda: st.builds(
            RemoveObject,
            object=st.sampled_from(objects_of(known)),
            offworld_position_m=st.just((-2.0, 0.0, -5.0)),
        ),
    }
    chosen = []
    for operation in operations:
        if operation not in strategies:
            raise OptionError.seen(
                "operation",
                operation,
                f" cannot be applied right after a reset. {did_you_mean(operation, AT_ONCE)}",
            )
        chosen.append(strategies[operation]())
    return st.one_of(chosen)


def vectors(limit_m: float, plane: bool = False) -> SearchStrategy[tuple[float, float, float]]:
    """(3,) lengths in m with components up to ``limit_m``; ``plane`` keeps the vertical one 0."""
    component = st.floats(-limit_m, limit_m)
    return st.tuples(component, component, st.just(0.0) if plane else component)


_AS_IT_WAS: Mapping[str, Mapping[str, tuple[float, ...]]] = MappingProxyType(
    {
        "shift_camera": MappingProxyType(
            {"delta_position_m": (0, 0, 0), "yaw_degrees": (0,), "delta_fovy_degrees": (0,)}
        ),
        "move_object": MappingProxyType({"delta_position_m": (0, 0, 0)}),
        "set_lighting": MappingProxyType({"scale": (1,)}),
        "set_visual_theme": MappingProxyType({"rgb_permutation": (0, 1, 2), "rgb_multiplier": (1, 1, 1)}),
    }
)
"""Parameters with which a change leaves every world as it was, by its operation."""


def alters(change: Json) -> bool:
    """Return True unless a change leaves every world about as it was, which a pair refuses."""
    neutral = _AS_IT_WAS.get(change["operation"])
    return neutral is None or any(
        not np.allclose(change.get(name, value), value, rtol=0, atol=1e-4) for name, value in neutral.items()
    )


def entities_or_tiny(entities: Entities | None) -> Entities:
    """Return the entities, or those of the tiny world where None are given."""
    if entities is not None:
        return entities
    from pytest_libero_max.substrates.tiny.world import TinyWorld

    return TinyWorld().entities


def objects_of(entities: Entities) -> list[str]:
    """Return the names of those that have a free joint."""
    return [name for name, entity in entities.items() if entity.kind == "object"]
