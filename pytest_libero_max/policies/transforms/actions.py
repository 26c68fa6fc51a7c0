"""Actions on their way from a model: columns, un-normalisation, gripper.

Actions are (n, d) float64 with the gripper in the last column. LIBERO's gripper closes at +1 and opens at -1.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import read_text
from pytest_libero_max.errors import AdapterError, counted, did_you_mean
from pytest_libero_max.policies.transforms.states import Array

Rule = Literal["quantiles", "bounds", "mean"]
"""Meaning of a normalised 1 and -1: the 99th and 1st percentile, the largest and smallest value, or one
standard deviation from the mean."""

_KEYS: Mapping[Rule, tuple[str, str]] = MappingProxyType(
    {
        "quantiles": ("q01", "q99"),
        "bounds": ("min", "max"),
        "mean": ("mean", "std"),
    }
)


def first_columns(actions: Array, count: int) -> Array:
    """(n, count): the first columns."""
    if actions.ndim != 2 or actions.shape[1] < count:
        raise AdapterError(f"Actions of shape {actions.shape} have no {counted(count, 'column')}.")
    return actions[:, :count].copy()


def clip(actions: Array) -> Array:
    """Every component cut to [-1, 1]."""
    return np.clip(actions, -1.0, 1.0)


def gripper_from_opening(actions: Array) -> Array:
    """Convert the gripper from 0 (close) to 1 (open) to LIBERO's sign: ``-sign(2 g - 1)``, 0 for a half."""
    return _with_gripper(actions, -np.sign(actions[:, -1] - 0.5) + 0.0)


def gripper_from_open_flag(actions: Array) -> Array:
    """Convert the gripper from a flag, 1 for open, to LIBERO's sign: ``1 - 2 (g > 0.5)``."""
    return _with_gripper(actions, 1.0 - 2.0 * (actions[:, -1] > 0.5))


def gripper_from_close_flag(actions: Array) -> Array:
    """Convert the gripper from a flag or probability of close to LIBERO's sign: 1 above a half, else -1."""
    return _with_gripper(actions, np.where(actions[:, -1] > 0.5, 1.0, -1.0))


def gripper_sign(actions: Array) -> Array:
    """Set the gripper to -1 where it is negative, else to +1."""
    return _with_gripper(actions, np.where(actions[:, -1] < 0.0, -1.0, 1.0))


def gripper_inverted(actions: Array) -> Array:
    """Change the sign of the gripper."""
    return _with_gripper(actions, 0.0 - actions[:, -1])


def gripper_flag_below_half(actions: Array) -> Array:
    """Set the gripper to 0 below a half, else to 1, as some models need before un-normalisation."""
    return _with_gripper(actions, np.where(actions[:, -1] < 0.5, 0.0, 1.0))


def pose_from_rotation_6d(actions: Array) -> Array:
    """(n, 7) of (n, 10): position, axis times angle (rad), gripper; of position, two columns, gripper.

    The two columns need be neither of length one nor at right angles: the first gives the x axis, the rest of
    the second the y axis.
    """
    if actions.ndim != 2 or actions.shape[1] != 10:
        raise AdapterError(
            f"Actions of shape {actions.shape} are no (n, 10): position, two columns, gripper."
        )
    from scipy.spatial.transform import Rotation

    x = _unit(actions[:, 3:6])
    y = _unit(actions[:, 6:9] - (x * actions[:, 6:9]).sum(axis=1, keepdims=True) * x)
    turns = Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=2)).as_rotvec()
    return np.concatenate([actions[:, :3], turns, actions[:, 9:]], axis=1)


@dataclass(frozen=True)
class Statistics:
    """Normalisation of a model's actions."""

    low: Array
    """(d,) value of -1; the mean for the rule ``mean``."""
    high: Array
    """(d,) value of 1; the standard deviation for the rule ``mean``."""
    mask: NDArray[np.bool_]
    """(d,) True for columns that are normalised; the others are left unchanged."""
    rule: Rule
    """Kind of the numbers in the statistics file."""

    def __post_init__(self) -> None:
        if not self.low.shape == self.high.shape == self.mask.shape or self.low.ndim != 1:
            raise AdapterError(
                f"Statistics of shapes {self.low.shape}, {self.high.shape} and {self.mask.shape}, but the "
                "numbers and the mask have one entry for each column."
            )
        if not (np.isfinite(self.low).all() and np.isfinite(self.high).all()):
            raise AdapterError("Statistics hold a number that is not finite. Check the statistics file.")


def unnormalise(actions: Array, statistics: Statistics) -> Array:
    """Return actions in the units of the training data from a model's normalised ones.

    Args:
        actions: (n, d); for the rules ``quantiles`` and ``bounds`` they are cut to [-1, 1] first.
    """
    if actions.ndim != 2 or actions.shape[1] != len(statistics.low):
        raise AdapterError(
            f"Actions of shape {actions.shape} and statistics of {counted(len(statistics.low), 'column')} "
            "do not go together. Take the statistics that belong to these weights."
        )
    low, high = statistics.low, statistics.high
    if statistics.rule == "mean":
        return np.where(statistics.mask, actions * high + low, actions)
    cut = np.clip(actions, -1.0, 1.0)
    return np.where(statistics.mask, 0.5 * (cut + 1.0) * (high - low) + low, cut)


def read_statistics(path: Path, key: str | None = None, rule: Rule = "bounds") -> Statistics:
    """Read the action statistics of a ``dataset_statistics.json``.

    Args:
        path: A JSON file: ``{key: {"action": {"min": [...], "max": [...], "mask": [...]}}}``.
        key: Key of the entry; may be left out where there is one.
    """
    try:
        entries = json.loads(read_text(path))
    except (OSError, ValueError, RecursionError) as error:
        raise AdapterError(
            f"Statistics file {str(path)!r} cannot be read: {error}. Check the path."
        ) from None
    if not isinstance(entries, dict) or not entries:
        raise AdapterError(f"Statistics file {str(path)!r} has no entries; it maps keys to statistics.")
    if key is None and len(entries) > 1:
        raise AdapterError(
            f"Statistics file {str(path)!r} has several entries: {', '.join(sorted(entries))}. Name one as "
            "key."
        )
    key = next(iter(entries)) if key is None else key
    if key not in entries:
        raise AdapterError(
            f"Statistics file {str(path)!r} has no entry {key!r}. {did_you_mean(key, entries)}"
        )
    return _statistics(entries[key], rule, f"{str(path)!r}, entry {key!r}")


def _statistics(entry: Any, rule: Rule, where: str) -> Statistics:
    action = entry.get("action") if isinstance(entry, dict) else None
    low, high = _KEYS[rule]
    if not isinstance(action, dict) or low not in action or high not in action:
        raise AdapterError(
            f"Statistics {where} lack action.{low} or action.{high}, which rule {rule!r} needs."
        )
    try:
        numbers = [np.array(action[name], dtype=np.float64) for name in (low, high)]
        mask = np.array(action.get("mask", np.ones(numbers[0].shape)), dtype=bool)
    except (TypeError, ValueError, OverflowError) as error:
        raise AdapterError(
            f"Statistics {where}: action.{low}, action.{high} or action.mask are no numbers ({error})."
        ) from None
    return Statistics(numbers[0], numbers[1], mask, rule)


def _with_gripper(actions: Array, gripper: NDArray[Any]) -> Array:
    changed = np.array(actions, dtype=np.float64)
    changed[:, -1] = gripper
    return changed


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not (lengths > 1e-9).all():
        raise AdapterError("A rotation in six numbers has a column of length 0, or two parallel ones.")
    return np.asarray(vectors / lengths)
