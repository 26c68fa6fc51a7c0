"""Change of the image from query to query."""

from __future__ import annotations

import numpy as np

from pytest_libero_max.pairing.probes.monitor import IMAGE_SIZE, Monitor
from pytest_libero_max.policies.check import Actions
from pytest_libero_max.worlds.contract import Observation


class ImageChange(Monitor[bytes]):
    """Mean absolute difference of the scene camera's image from the one before, in levels of 255."""

    name = "image_change"
    cost = "one image of 64 pixels a query"
    cameras = ("agentview",)

    def observe(
        self, memory: bytes | None, observation: Observation, actions: Actions, step: int
    ) -> tuple[bytes, float]:
        """Return the image, and its difference from the one before."""
        image = observation["agentview_image"]
        before = np.frombuffer(memory or image.tobytes(), np.uint8).reshape(IMAGE_SIZE, IMAGE_SIZE, 3)
        return image.tobytes(), float(np.abs(image.astype(np.int64) - before).mean())
