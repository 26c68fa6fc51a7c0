"""Traces: the trajectories of a pair, step by step, for whoever wants to look or to recompute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.pairing.rollout import RolloutResult
from pytest_libero_max.pairing.runner import Pair


def write_trace(folder: Path, pair: Pair) -> Path:
    """Write ``<item id>.npz``.

    It holds ``trigger_step``, -1 where the event never fired, and for each arm that was played
    ``<arm>_actions`` (n, 7), ``<arm>_query_steps``, and after each policy step ``<arm>_end_effector`` (n, 3)
    and ``<arm>_entity`` (n, 3; the trigger entity), both in m in the world frame.

    Args:
        folder: Made if missing.
        pair: What to keep.

    Returns:
        The path of the file.
    """
    step = pair.record.trigger_step
    arrays: dict[str, NDArray[np.generic]] = {"trigger_step": np.array(-1 if step is None else step)}
    for name, arm in pair.record.arms.items():
        if arm.shares is None:
            arrays |= _arm(name, pair.rollouts[name])
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{pair.record.item_id}.npz"
    np.savez_compressed(path, allow_pickle=False, **arrays)
    return path


def _arm(name: str, rollout: RolloutResult) -> dict[str, NDArray[np.generic]]:
    return {
        f"{name}_actions": rollout.actions,
        f"{name}_end_effector": rollout.end_effector,
        f"{name}_entity": rollout.entity,
        f"{name}_query_steps": np.array([answer.step for answer in rollout.answers]),
    }
