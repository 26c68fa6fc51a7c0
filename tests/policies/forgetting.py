"""Tests load one adapter after the other in one process."""

from __future__ import annotations

from pytest_libero_max.policies import loading


def forget_adapter() -> None:
    """Undo the effects of the last adapter file on ``sys.path`` and ``sys.modules``."""
    loading._BESIDE.leave()
