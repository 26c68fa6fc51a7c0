"""Monitors scored over the recorded pairs of a run: no policy is asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from msgspec.structs import replace

from pytest_libero_max.benchmark.cases import Case
from pytest_libero_max.errors import ReportError
from pytest_libero_max.films.recorded import RecordedRun
from pytest_libero_max.films.replay import View, play_again
from pytest_libero_max.pairing.probes.monitor import IMAGE_SIZE, Monitor
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.pairing.trace import ArmTrace
from pytest_libero_max.runs.replay_command import traces_setting
from pytest_libero_max.worlds.contract import Observation, World


def scored(run: RecordedRun, record: PairRecord, monitors: Sequence[Monitor[Any]]) -> PairRecord:
    """Return a pair with the scores that these monitors would have given while it was played.

    A monitor without cameras is given the recorded answers alone, and its scores are those of a run with its
    probe. Images are drawn again: of the recorded positions, in single precision, or of the recorded actions
    executed again where the run kept no positions.

    Raises:
        ReportError: The run kept no traces of the pair, or none with the answers of the policy.
        ProtocolError: The recorded actions do not reach the recorded digests.
    """
    traces = run.traces(record)
    for name, trace in traces.items():
        if trace.answers is None:
            raise ReportError(
                f"{record.item_id}: the trace of arm {name!r} is of an early version and has no answers of "
                f"the policy. Play the pair again with {traces_setting(run.stored.run.provenance)}."
            )
    cameras = tuple(sorted({camera for monitor in monitors for camera in monitor.cameras}))
    seen: dict[tuple[str, int], Observation] = {}

    def draw(case: Case, world: World, traces: Mapping[str, ArmTrace]) -> None:
        for name, trace in traces.items():
            asked = frozenset(trace.query_steps.tolist())

            def look(name: str, step: int, world: World, before: View | None) -> View:
                if step in asked:  # noqa: B023 - called before the next arm
                    seen[name, step] = world.observe(cameras, IMAGE_SIZE)
                return View({}, 0.0)

            alone = replace(record, arms={name: record.arms[name]})
            for _ in play_again(
                case, world, alone, traces, look, max(len(trace.actions), 1), asked, simulate=False
            ):
                pass

    if cameras:
        run.again(record, draw)
    arms = {}
    for name, arm in record.arms.items():
        played = arm.shares or name
        probes = {one.name: _columns(one, played, traces[played], seen) for one in monitors}
        arms[name] = replace(arm, probes={**arm.probes, **probes})
    return replace(record, arms=arms)


def _columns(
    monitor: Monitor[Any], arm: str, trace: ArmTrace, seen: Mapping[tuple[str, int], Observation]
) -> dict[str, Any]:
    """Return step and score of each query of an arm."""
    assert trace.answers is not None
    memory, scores = None, []
    for step, answer in zip(trace.query_steps.tolist(), trace.answers, strict=True):
        actions = answer[~np.isnan(answer).any(axis=1)]
        memory, score = monitor.observe(memory, seen.get((arm, step), {}), actions, step)
        scores.append(float(score))
    return {"step": trace.query_steps.tolist(), "score": scores}
