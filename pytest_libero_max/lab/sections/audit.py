"""Audit of inputs: which of them a policy needs, each arm of the study ``audit`` beside Base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pytest_libero_max.events.schedules import BASE, BASE_AGAIN, DYNAMIC, SHAM, SHAM_DYNAMIC
from pytest_libero_max.lab.studies.audit import Audit
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.document import Section, Table
from pytest_libero_max.report.formats import Change, Counts
from pytest_libero_max.report.measures import MEASURE, Measured, Rows, measures_of
from pytest_libero_max.report.quantities import Cell
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import PlayedPairs, ReportSection
from pytest_libero_max.stats.significance import holm, mcnemar

TITLE = "Success without an input"
NOTE = (
    "Each arm is paired with Base over the cases that were played in both. A policy that reads the simulator "
    "(privileged) can do without any of its inputs. Black images, zeros and missing words are unlike all "
    "training data: a loss shows that the policy uses the input, not how. An arm is not played where its "
    "input would be the case's own."
)
INTERVAL_NOTE = (
    "Exact 95% intervals, each for itself. The p-value of the exact McNemar test is adjusted for the number "
    "of arms (Holm), and decides at 5%."
)

_INPUTS = {
    "black_images": "all images black",
    "still_images": "all images as at the first query",
    "other_images": "all images as at the first query of another task",
    "no_state": "robot state of zeros",
    "no_instruction": "no instruction",
    "other_instruction": "instruction of another task of the suite",
    "paraphrase": "instruction in other words",
}
"""What is changed in an arm; the other arms show one camera black."""

QUANTITIES = {
    "success": ("success", "share"),
    "change": ("less Base", "change"),
    "lost": ("lost", "cases"),
    "gained": ("gained", "cases"),
    "p": ("adjusted p", "p"),
}
"""Titles and units of the numbers of an arm, by the end of their names in gates."""

_VERDICT = "verdict"
_NO_BASE = "Base never succeeds"
_LEVEL = 0.05


class AuditOfInputs(ReportSection):
    """Cases of the study ``audit``."""

    name = "audit"
    option = "--libero-max-study=audit"

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        study = played.protocol.get("study") or {}
        if not played.records or study.get("name") != Audit.name:
            return {}
        base = sum(record.base_success for record in played.records)
        rows = _measured(BASE, "success").share(
            [record.base_success for record in played.records], with_interval=False
        )
        arms = {name: _ends(name, played.records) for name in _arms(played.records)}
        tests = [
            mcnemar(ends.count((True, False)), ends.count((False, True))) if played.with_intervals else None
            for ends in arms.values()
        ]
        for (name, ends), log10_p in zip(arms.items(), holm(tests), strict=True):
            rows |= _arm(name, ends, log10_p)
            rows[f"{name}: {_VERDICT}"] = _verdict(ends, log10_p) if base else _NO_BASE
        return {TITLE: rows}

    def quantity(self, name: str) -> Measured | None:
        section, _, rest = name.partition(".")
        arm, _, key = rest.partition(".")
        known = section == self.name and arm and key in QUANTITIES
        return _measured(arm, key) if known else None

    def shown(self, report: Report) -> Mapping[str, Section]:
        tables = input_tables(report)
        return {TITLE: Section(tables=tables)} if tables else {}


def _measured(arm: str, key: str) -> Measured:
    title, unit = QUANTITIES[key]
    return Measured(f"audit.{arm}.{key}", f"{arm}: {title}", unit)


def _arms(records: Sequence[PairRecord]) -> list[str]:
    usual = (BASE, DYNAMIC, SHAM, SHAM_DYNAMIC, BASE_AGAIN)
    return [name for name in dict.fromkeys(name for it in records for name in it.arms) if name not in usual]


def _ends(arm: str, records: Sequence[PairRecord]) -> list[tuple[bool, bool]]:
    """Return success in Base and in an arm, of the cases that were played in it."""
    return [(record.base_success, bool(record.arms[arm].success)) for record in records if arm in record.arms]


def _arm(name: str, ends: list[tuple[bool, bool]], log10_p: float | None) -> Rows:
    base, changed = zip(*ends, strict=True)
    rows = _measured(name, "success").share(changed, with_interval=False)
    rows |= _measured(name, "change").change(base, changed)
    rows |= _measured(name, "lost").row(ends.count((True, False)))
    rows |= _measured(name, "gained").row(ends.count((False, True)))
    return rows | _measured(name, "p").row(None if log10_p is None else 10**log10_p)


def _verdict(ends: list[tuple[bool, bool]], log10_p: float | None) -> str:
    lost, gained = ends.count((True, False)), ends.count((False, True))
    if log10_p is None:
        return "n/a"
    if lost == gained == 0:
        return "no case differs"
    if 10**log10_p >= _LEVEL:
        return "not shown to matter"
    return "needed" if lost > gained else "better without"


def input_tables(report: Report) -> list[Table]:
    """Return the table of a run of the study ``audit``; none for another run."""
    rows = report.sections.get(TITLE)
    if rows is None:
        return []
    measures = measures_of({TITLE: rows})
    arms = [key.split(".")[1] for key in measures if key.endswith(".change")]
    base = measures[_measured(BASE, "success").key]
    cells: list[tuple[Any, ...]] = [(BASE, "nothing", Cell(base, Counts()), "", "", "", "", "")]
    for arm in arms:
        success, change, *others = (measures[_measured(arm, key).key] for key in QUANTITIES)
        cells.append(
            (
                arm,
                _INPUTS.get(arm, f"images of {arm.removeprefix('no_')} black"),
                Cell(success, Counts()),
                Cell(change, Change()),
                *(Cell(number, MEASURE) for number in others),
                rows[f"{arm}: {_VERDICT}"],
            )
        )
    head = ("Arm", "Changed before the first query", "Success", "Less Base", "Lost", "Gained", "p", "Verdict")
    return [Table(TITLE, head, cells, NOTE, narrow=4).explaining_intervals(INTERVAL_NOTE)]
