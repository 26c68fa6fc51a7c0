"""camera_shift: the camera that looks at the agent is elsewhere, turned and zoomed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.kind import EventKind, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

SHIFTS = (((0.06, 0.0, 0.02), 18.0, 12.0), ((-0.06, 0.03, 0.0), -22.0, -12.0))
"""Movement (3,) in m in the world frame, turn about the vertical and change of the field of view, both in
degrees, by variant."""


class CameraShift(EventKind):
    """The agent's camera moves by 6 to 7 cm, turns by 18 or 22 degrees, and widens or narrows its view."""

    name = "camera_shift"
    family = "observation"
    code = "OBS"
    severities = ("high", "high")
    response = "continue"
    expected = (
        "Go on with the same plan, with positions corrected for the new viewpoint: nothing in the scene has "
        "moved."
    )

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        delta, yaw, fovy = SHIFTS[variant]
        return Scenario(
            {
                "operation": "shift_camera",
                "camera": task.camera,
                "delta_position_m": list(delta),
                "yaw_degrees": yaw,
                "delta_fovy_degrees": fovy,
                "calibration": "fixed_global_viewpoint",
            }
        )

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Shifts of any camera, in any direction."""
        from pytest_libero_max.events.change_strategies import changes

        return changes(entities, operations=["shift_camera"]).map(lambda change: Scenario(change.to_dict()))
