"""The part of a report that is about a study: computed from the records, like everything else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC, SHAM, SHAM_DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies.study_cadence import cadence_results, latency_results
from pytest_libero_max.report.studies.study_camera import camera_results
from pytest_libero_max.report.studies.study_document import (
    ArmContrast,
    Executed,
    Study,
)
from pytest_libero_max.stats.blocks import Rate
from pytest_libero_max.stats.measured import ends, number, rate_of
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.studies.cadence_sweep import CadenceSweep
from pytest_libero_max.studies.camera_study import CameraTiming
from pytest_libero_max.studies.latency_sweep import LatencySweep
from pytest_libero_max.studies.registry import study_from_dict

_USUAL = frozenset((BASE, DYNAMIC, SHAM, SHAM_DYNAMIC, BASE_AGAIN))
"""Arms of runs without a study."""


def study_of(records: Sequence[PairRecord], tasks: Sequence[str], protocol: Json) -> Study | None:
    """Return the results of a study; None where the run was of none.

    Args:
        records: Measured cases, in the order of the report.
        tasks: The reference task of each.
        protocol: Of the header of the run.

    Raises:
        ReportError: A record lacks an arm of the study, or the study is not known.
    """
    if protocol.get("study") is None:
        return _further_arms(records)
    study = study_from_dict(protocol["study"])
    camera = camera_results(study, records, tasks) if isinstance(study, CameraTiming) else None
    cadence = cadence_results(study, records) if isinstance(study, CadenceSweep) else None
    latency = latency_results(study, records) if isinstance(study, LatencySweep) else None
    known = any(part is not None for part in (camera, cadence, latency))
    arms: dict[str, Any] = {"arms": success_by_arm(records)} if study.has_section else {}
    if not (known or study.has_section):
        arms = _arms(records)
    return Study(
        name=study.name,
        title=study.title,
        cases=len(records),
        **arms,
        camera=camera,
        cadence=cadence,
        latency=latency,
        executed=executed(records),
    )


def _further_arms(records: Sequence[PairRecord]) -> Study | None:
    """Success by arm in a run without a study; None where no program gives a case further arms."""
    if not any(record.arms.keys() - _USUAL for record in records):
        return None
    return Study(
        name="arms",
        title="arms of programs",
        cases=len(records),
        **_arms(records),
        executed=executed(records),
    )


def _arms(records: Sequence[PairRecord]) -> dict[str, Any]:
    """Return what is reported of arms without a part of the report of their own."""
    events = sorted({record.event for record in records}, key=[*EVENTS].index)
    by_event = {event: [record for record in records if record.event == event] for event in events}
    arms = success_by_arm(records)
    others = [name for name in arms if name not in _USUAL]
    pairs = [pair for name in others for pair in ((name, BASE), (DYNAMIC, name))]
    return {
        "arms": arms,
        "by_event": {event: success_by_arm(some) for event, some in by_event.items()},
        "contrasts": [
            _contrast(first, second, event, some)
            for first, second in pairs
            for event, some in ((None, records), *by_event.items())
        ],
    }


def _contrast(first: str, second: str, event: str | None, records: Sequence[PairRecord]) -> ArmContrast:
    both = [
        (record.arms[first].success, record.arms[second].success)
        for record in records
        if first in record.arms and second in record.arms
    ]
    gains, losses, cases = both.count((True, False)), both.count((False, True)), len(both)
    lower, upper = ends(paired_difference(losses, gains, cases))
    return ArmContrast(
        first=first,
        second=second,
        event=event,
        cases=cases,
        gains=gains,
        losses=losses,
        value=number((gains - losses) / cases if cases else None),
        lower=lower,
        upper=upper,
    )


def success_by_arm(records: Sequence[PairRecord]) -> dict[str, Rate]:
    """Success by arm, over the cases that were played in it, in the order of the arms."""
    names = dict.fromkeys(name for record in records for name in record.arms if name != BASE_AGAIN)
    rates: dict[str, Rate] = {}
    for name in names:
        ends = [record.arms[name].success for record in records if name in record.arms]
        ratio = Ratio(sum(ends), len(ends))
        rates[name] = rate_of(ratio)
    return rates


def executed(records: Sequence[PairRecord]) -> Executed:
    """Count the executed steps and queries, and those of the same arms in two other ways.

    ``singly``: every arm by itself from the start. ``as_pairs``: every arm with an event in a pair with a
    Base of its own, as runs without a study would play it. Settle steps, and queries that were asked again
    to check the policy, are not counted.
    """
    ways = ("", "_singly", "_as_pairs")
    totals: dict[str, int] = {"arms": 0, **{what + way: 0 for what in ("steps", "queries") for way in ways}}
    for record in records:
        for name, arm in record.arms.items():
            base = record.arms.get(BASE + name.removeprefix(DYNAMIC), record.arm(BASE))
            totals["arms"] += 1
            for what, own in zip(("steps", "queries"), _own(arm), strict=True):
                totals[what] += own
                totals[f"{what}_singly"] += getattr(arm, what) or 0
                if arm.schedule:
                    totals[f"{what}_as_pairs"] += own + (getattr(base, what) or 0)
    return Executed(**totals)


def _own(arm: ArmRecord) -> tuple[int, int]:
    """Return the steps and queries of this arm alone: it parts from another at its first event."""
    if arm.shares is not None:
        return 0, 0
    first: Any = arm.firings[0] if arm.firings else None
    shared = (0, 0) if first is None else (first.step, first.queries)
    return arm.steps - shared[0], arm.queries - shared[1]
