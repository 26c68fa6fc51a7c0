"""The part of a report that is about a study or a program: computed from the records, like the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.programs import program_of_run
from pytest_libero_max.events.registry import EVENTS
from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC, SHAM, SHAM_DYNAMIC
from pytest_libero_max.pairing.record import ArmRecord, PairRecord
from pytest_libero_max.report.studies.study_document import ArmContrast, Executed, Study
from pytest_libero_max.report.studies.study_section import STUDY_SECTIONS
from pytest_libero_max.report.studies.study_settings import (
    best_settings,
    measured_settings,
    own_ways,
    settings_of,
)
from pytest_libero_max.stats.blocks import Rate
from pytest_libero_max.stats.measured import ends, number, rate_of
from pytest_libero_max.stats.paired_difference import paired_difference
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.studies.registry import study_from_dict

_USUAL = frozenset((BASE, DYNAMIC, SHAM, SHAM_DYNAMIC, BASE_AGAIN))
"""Arms of runs without a study."""


def study_of(records: Sequence[PairRecord], tasks: Sequence[str], protocol: Json) -> Study | None:
    """Return the results of a study, or of the further arms of programs; None where there are none.

    Raises:
        ReportError: A record lacks an arm of the study, or the study is not known.
    """
    study = None if protocol.get("study") is None else study_from_dict(protocol["study"])
    program = program_of_run(protocol) if study is None else study.program
    if study is None and not any(record.arms.keys() - _USUAL for record in records):
        return None
    head: dict[str, Any] = {
        "name": "arms" if study is None else study.name,
        "title": "arms of programs" if study is None else study.title,
        "about": "" if program is None else program.about,
        "cases": len(records),
        "executed": executed(records),
    }
    if study is not None and study.name in STUDY_SECTIONS:
        return Study(**head, camera=STUDY_SECTIONS[study.name].results(study, records, tasks))
    if study is not None and study.has_section:
        return Study(**head, arms=success_by_arm(records), ways=own_ways((), records, _names(records)))
    spelled = () if program is None else program.arms
    settings = settings_of(spelled, records) if records else []
    paired = {name for setting in settings for name in (setting.base, setting.dynamic)}
    further = {name for record in records for name in record.arms} - _USUAL - paired
    return Study(
        **head,
        settings=measured_settings(settings, records, tasks),
        best=best_settings(settings, records) if settings else {},
        ways=own_ways(spelled, records, [name for name in _names(records) if name in further]),
        **(_arms(records, further) if further or not settings else {}),
    )


def _arms(records: Sequence[PairRecord], further: set[str]) -> dict[str, Any]:
    events = sorted({record.event for record in records}, key=[*EVENTS].index)
    by_event = {event: [record for record in records if record.event == event] for event in events}
    arms = {name: rate for name, rate in success_by_arm(records).items() if name in _USUAL | further}
    pairs = [pair for name in arms if name in further for pair in ((name, BASE), (DYNAMIC, name))]
    return {
        "arms": arms,
        "by_event": {
            event: {name: rate for name, rate in success_by_arm(some).items() if name in arms}
            for event, some in by_event.items()
        },
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
    rates: dict[str, Rate] = {}
    for name in _names(records):
        ends = [record.arms[name].success for record in records if name in record.arms]
        rates[name] = rate_of(Ratio(sum(ends), len(ends)))
    return rates


def _names(records: Sequence[PairRecord]) -> list[str]:
    names = dict.fromkeys(name for record in records for name in record.arms)
    return [name for name in names if name != BASE_AGAIN]


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
