"""An adapter whose policy costs nothing."""

from __future__ import annotations

from typing import Any

import numpy as np

from pytest_libero_max import PolicySpec


class Nothing:
    """Returns ten actions that are zero."""

    spec = PolicySpec("nothing", 10, 5)

    def reset(self, episode: Any) -> None:
        pass

    def predict(self, observation: Any, query: Any) -> Any:
        return np.zeros((10, 7))


policy = Nothing
