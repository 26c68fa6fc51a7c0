"""Moments of a pair along its film: the event, stale actions, the end of each arm, and curves of traces."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.trace import read_trace, trace_name
from pytest_libero_max.report.palette import arm_kinds
from pytest_libero_max.runs.media import TRACES_NAME
from pytest_libero_max.runs.outside import require_inside

_MOST_POINTS = 200
"""Number of points of a curve, of which a page draws few more than it has pixels."""


def timeline_of(record: PairRecord, folder: Path | None = None) -> Json:
    """Return the moments of a pair, in policy steps.

    Returns:
        ``steps``: of the longest arm. ``arms``: by name, ``end`` (steps), ``success``, ``events`` (steps),
        ``stale`` (number of stale actions after the first event) and ``kind`` (class of its colour); where
        the trace is kept, ``curve``:
        distance of the hand to the trigger entity in mm, one value ``every`` so many steps.
    """
    arms: Json = {}
    curves = {} if folder is None else _curves(record, folder)
    for name, arm in record.arms.items():
        if arm.shares is None:
            arms[name] = {
                "end": arm.steps,
                "success": arm.success,
                "events": [firing.step for firing in arm.firings],
                "stale": arm.stale_actions or 0,
                **curves.get(name, {}),
            }
    kinds = arm_kinds(arms)
    for name, arm_moments in arms.items():
        arm_moments["kind"] = kinds[name]
    return {"steps": max((arm["end"] for arm in arms.values()), default=0), "arms": arms}


def _curves(record: PairRecord, folder: Path) -> Json:
    """Return the curves of the arms; none where the trace is missing or cannot be read."""
    path = folder / TRACES_NAME / trace_name(record.item_id)
    if not path.is_file():
        return {}
    try:
        traces = read_trace(require_inside(folder, path), record)
    except ReportError:
        return {}
    curves = {}
    for name, trace in traces.items():
        if not trace.actions.size:
            continue
        every = 1 + len(trace.actions) // _MOST_POINTS
        distances = np.linalg.norm(trace.end_effector - trace.entity, axis=1)
        curves[name] = {"every": every, "curve": np.rint(1000 * distances[::every]).astype(int).tolist()}
    return curves
