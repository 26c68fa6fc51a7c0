"""visual_theme_switch: every surface of the scene changes its colour."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.kind import EventKind, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

THEMES = (((2, 0, 1), (0.70, 1.15, 1.30)), ((1, 2, 0), (1.25, 0.70, 1.10)))
"""Order in which red, green and blue are taken, and what each is then multiplied with, by variant."""


class VisualThemeSwitch(EventKind):
    """The colours of all surfaces are exchanged and rescaled, channel by channel."""

    name = "visual_theme_switch"
    family = "appearance_and_clutter"
    code = "OBS"
    severities = ("high", "high")
    response = "continue"
    expected = "Go on with the same plan: nothing in the scene has moved, only its colours have changed."

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        permutation, multiplier = THEMES[variant]
        return Scenario(
            {
                "operation": "set_visual_theme",
                "rgb_permutation": list(permutation),
                "rgb_multiplier": list(multiplier),
            }
        )

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Any exchange of the colour channels."""
        from pytest_libero_max.events.change_strategies import changes

        return changes(entities, operations=["set_visual_theme"]).map(
            lambda change: Scenario(change.to_dict())
        )
