"""illumination_switch: all lights become darker or brighter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.kind import EventKind, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

SCALES = (0.20, 1.80)
"""Factor of the light, by variant."""


class IlluminationSwitch(EventKind):
    """All lights of the scene become five times darker (variant 0) or almost twice as bright (variant 1)."""

    name = "illumination_switch"
    family = "appearance_and_clutter"
    code = "OBS"
    severities = ("high", "high")
    response = "continue"
    expected = "Go on with the same plan: nothing in the scene has moved, only its pictures have changed."

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        return Scenario({"operation": "set_lighting", "scale": SCALES[variant]})

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Any change of the light."""
        from pytest_libero_max.events.change_strategies import changes

        return changes(entities, operations=["set_lighting"]).map(lambda change: Scenario(change.to_dict()))
