"""sensor_noise_onset: from now on every picture is noisy and partly covered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pytest_libero_max.events.kind import EventKind, Scenario

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from pytest_libero_max.benchmark.identity import Identity
    from pytest_libero_max.tasks.contents import TaskMetadata
    from pytest_libero_max.worlds.contract import Entity

CORRUPTIONS = ((24.0, 0.08), (36.0, 0.16))
"""Standard deviation of the noise in grey levels (0 to 255) and covered share of the picture, by variant."""


class SensorNoiseOnset(EventKind):
    """Every picture of every camera gets Gaussian noise and a black rectangle, until the episode ends."""

    name = "sensor_noise_onset"
    family = "observation"
    code = "OBS"
    severities = ("high", "high")
    response = "continue"
    expected = "Go on with the same plan, with what the pictures still show: nothing in the scene has moved."

    def resolve(self, variant: int, task: TaskMetadata, identity: Identity) -> Scenario:
        noise, occlusion = CORRUPTIONS[variant]
        return Scenario(
            {
                "operation": "set_sensor_corruption",
                "noise_std": noise,
                "occlusion_fraction": occlusion,
                "seed": identity.seed(self.name, variant),
            }
        )

    def strategy(self, entities: Mapping[str, Entity], trigger: str, seed: int) -> SearchStrategy[Scenario]:
        """Noise and covers of any size, with the scenario's seed."""
        from hypothesis import strategies as st

        from pytest_libero_max.changes import SetSensorCorruption

        corruptions = st.builds(SetSensorCorruption, st.floats(1.0, 40.0), st.floats(0.0, 0.3), st.just(seed))
        return corruptions.map(lambda change: Scenario(change.to_dict()))
