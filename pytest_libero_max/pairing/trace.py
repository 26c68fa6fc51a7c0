"""Traces: the trajectories of a pair, step by step, to look at it again or to recompute it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.array_files import read_arrays
from pytest_libero_max.errors import ReportError, counted
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.rollout import RolloutResult
from pytest_libero_max.pairing.runner import Pair


@dataclass(frozen=True, eq=False)
class ArmTrace:
    """Steps of an arm that was played, shared ones included.

    With the record and the case this is enough to play the arm again.
    """

    actions: NDArray[np.float64]
    """(n, d) float64, as the policy returned them."""
    query_steps: NDArray[np.int64]
    """(q,) policy steps executed before each query."""
    end_effector: NDArray[np.float64]
    """(n, 3) m, world frame, after each step."""
    entity: NDArray[np.float64]
    """(n, 3) m, world frame: the trigger entity after each step."""
    joints: NDArray[np.float32] | None = None
    """(n, nq) positions of all joints of the world after each step, in single precision, from which a film is
    drawn; None where the run was to make none."""
    answers: NDArray[np.float64] | None = None
    """(q, H, d) float64, all that the policy answered at each query, executed or not, NaN behind the end of a
    shorter answer; None in traces of an early version."""


def traces_of(pair: Pair) -> dict[str, ArmTrace]:
    """Return the trace of each arm that was played, by name."""
    return {name: _trace(pair.rollouts[name]) for name, arm in pair.record.arms.items() if arm.shares is None}


def trace_name(item_id: str) -> str:
    """Name of the file that holds the traces of a pair."""
    return f"{item_id}.npz"


def write_trace(folder: Path, pair: Pair) -> Path:
    """Write ``<item id>.npz``.

    It holds ``trigger_step``, -1 where the event never fired, and for each arm that was played
    ``<arm>_actions``, ``<arm>_query_steps``, ``<arm>_end_effector``, ``<arm>_entity`` and
    ``<arm>_answers`` (:class:`ArmTrace`), with ``<arm>_joints`` where they were kept.

    Returns:
        The path of the file.
    """
    step = pair.record.trigger_step
    arrays: dict[str, NDArray[np.generic]] = {"trigger_step": np.array(-1 if step is None else step)}
    for name, trace in traces_of(pair).items():
        arrays |= {f"{name}_{part}": values for part, values in vars(trace).items() if values is not None}
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / trace_name(pair.record.item_id)
    np.savez_compressed(path, allow_pickle=False, **arrays)
    return path


def read_trace(path: Path, record: PairRecord) -> dict[str, ArmTrace]:
    """Read what :func:`write_trace` wrote of a pair, or raise ReportError.

    Returns:
        The trace of each arm that was played, by name.
    """
    try:
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise ReportError(
            f"Cannot read the trace {path}: {error}. Play the pair again with --libero-max-traces=all."
        ) from error
    traces = {}
    for name, arm in record.arms.items():
        if arm.shares is None:
            traces[name] = _read_arm(path, name, arm.steps, arrays)
    return traces


def _read_arm(path: Path, name: str, steps: int | None, arrays: Mapping[str, NDArray[Any]]) -> ArmTrace:
    width = np.shape(arrays.get(f"{name}_actions", ()))[-1:] or (0,)
    shapes = {"actions": (steps, *width), "end_effector": (steps, 3), "entity": (steps, 3)}
    parts = {part: arrays.get(f"{name}_{part}") for part in (*shapes, "query_steps", "joints", "answers")}
    for part, shape in shapes.items():
        values = parts[part]
        # What an arm without a step holds has no columns.
        if values is None or (values.shape != shape and not (steps == 0 and values.size == 0)):
            found = "is missing" if values is None else f"has shape {values.shape}"
            raise ReportError(
                f"{path}: {name}_{part} {found}, but the record of the pair says {shape}. The trace is of "
                "another run; play the pair again with --libero-max-traces=all."
            )
    joints = parts["joints"]
    if joints is not None and (len(joints) != steps or (steps and joints.ndim != 2)):
        raise ReportError(
            f"{path}: {name}_joints has shape {joints.shape}, but the record {counted(steps or 0, 'step')}."
        )
    if parts["query_steps"] is None:
        raise ReportError(f"{path} has no {name}_query_steps: it is no trace of a pair.")
    answers, queries = parts["answers"], parts["query_steps"].shape
    if answers is not None and (answers.ndim != 3 or answers.shape[::2] != (*queries, *width)):
        raise ReportError(f"{path}: {name}_answers has shape {answers.shape}, but of queries {queries}.")
    for part, values in parts.items():
        if values is not None and not _is_numbers(
            values, whole=part == "query_steps", gaps=part == "answers"
        ):
            raise ReportError(
                f"{path}: {name}_{part} has {values.dtype} values that are no finite numbers, or no list of "
                "steps. Play the pair again with --libero-max-traces=all."
            )
    return ArmTrace(**{part: values for part, values in parts.items() if values is not None})


def _is_numbers(values: NDArray[Any], *, whole: bool, gaps: bool) -> bool:
    """Return True if an array holds finite numbers; the gaps behind short answers are NaN."""
    if whole:
        return values.dtype.kind in "iu" and values.ndim == 1
    if values.dtype.kind not in "fiu":
        return False
    return not bool(np.isinf(values).any()) and (gaps or not bool(np.isnan(values).any()))


def _trace(rollout: RolloutResult) -> ArmTrace:
    answers = [query.actions for query in rollout.queries]
    width = answers[0].shape[1] if answers else 0
    padded = np.full((len(answers), max(map(len, answers), default=0), width), np.nan)
    for row, answer in zip(padded, answers, strict=True):
        row[: len(answer)] = answer
    return ArmTrace(
        actions=rollout.actions,
        query_steps=np.array([query.step for query in rollout.queries], dtype=np.int64),
        end_effector=rollout.end_effector,
        entity=rollout.entity,
        joints=rollout.joints,
        answers=padded,
    )
