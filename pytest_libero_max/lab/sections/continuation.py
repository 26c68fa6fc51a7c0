"""Controllers from one prefix: the arms of the study ``continue``, compared case by case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.events.schedules import BASE, DYNAMIC
from pytest_libero_max.lab.studies.continuation import OWN_BASE, RUN, Continue
from pytest_libero_max.pairing.record import PairRecord
from pytest_libero_max.report.document import Section, Table
from pytest_libero_max.report.formats import Change, Counts, counted
from pytest_libero_max.report.measures import MEASURE, Measured, Rows, measures_of
from pytest_libero_max.report.quantities import Cell
from pytest_libero_max.report.report_document import Report
from pytest_libero_max.report.sections import PlayedPairs, ReportSection
from pytest_libero_max.stats.significance import holm, mcnemar

TITLE = "Controllers that continue one prefix"
NOTE = (
    "The policy of the run plays Base and the executed prefix. From the state of the event each controller "
    "goes on: it is asked at once, and given the actions that were executed and those that were queued. A "
    "controller enters a state that another policy produced: its numbers say how it goes on from there, not "
    "how it would have come there. Suites that a controller does not play are left out of its rows."
)
HANDOVER_NOTE = (
    "Without the event the controller takes over at the same moment and nothing changes: that less Base is "
    "the effect of the handover, and Dynamic less that is the effect of the event. The own Base of a "
    "controller is played from the reset."
)
INTERVAL_NOTE = "Exact 95% intervals, each for itself."
P_NOTE = "p is of the exact McNemar test, adjusted for the number of contrasts in this table (Holm)."


PAIRS = Measured("continue.pairs", "pairs in which the event happened", "cases")


class _Column(NamedTuple):
    """A number of a controller: success in an arm, or success less that in another arm."""

    title: str
    arm: str
    """Name of the arm, with a place for the name of the controller."""
    less: str | None = None

    @property
    def is_of_own_base(self) -> bool:
        """True if it needs a Base that the controller plays itself."""
        return OWN_BASE in f"{self.arm} {self.less}"


_DYNAMIC_COLUMNS = {
    "success": _Column("Dynamic", f"{DYNAMIC}_{{}}"),
    "change": _Column("less Base", f"{DYNAMIC}_{{}}", BASE),
    "over_run": _Column("less Dynamic of the run's policy", f"{DYNAMIC}_{{}}", DYNAMIC),
}
_HANDOVER_COLUMNS = {
    "handed": _Column("No event", f"{BASE}_{{}}"),
    "handover": _Column("No event less Base", f"{BASE}_{{}}", BASE),
    "event": _Column("Dynamic less no event", f"{DYNAMIC}_{{}}", f"{BASE}_{{}}"),
    "own_base": _Column("Own Base", f"{OWN_BASE}_{{}}"),
    "over_own_base": _Column("Dynamic less own Base", f"{DYNAMIC}_{{}}", f"{OWN_BASE}_{{}}"),
}
_COLUMNS = {**_DYNAMIC_COLUMNS, **_HANDOVER_COLUMNS}
"""Numbers of a controller, by the end of their names in gates."""

_OVER, _P = "over_", "p_over_"


def _played(columns: Mapping[str, _Column], study: Continue) -> dict[str, _Column]:
    """Return the columns whose arms a study plays: without an own Base, not those of it."""
    return {key: column for key, column in columns.items() if study.own_base or not column.is_of_own_base}


class Continued(ReportSection):
    """Cases of the study ``continue``."""

    name = "continue"
    option = "--libero-max-study=continue"
    quantities = (PAIRS,)

    def tables(self, played: PlayedPairs) -> dict[str, Rows]:
        study = _study(played.protocol)
        if not played.records or study is None:
            return {}
        # Where the event never happens nobody takes over, and every arm is Base of the run's policy.
        played = replace(played, records=[it for it in played.records if it.arms[DYNAMIC].firings])
        rows: Rows = PAIRS.row(len(played.records))
        for line in _lines(study):
            for key, column in _played(line.columns, study).items():
                rows |= _number(line.name, key, column, played.records)
        return {TITLE: rows | _contrasts(study, played)}

    def quantity(self, name: str) -> Measured | None:
        section, _, rest = name.partition(".")
        controller, _, key = rest.partition(".")
        known = key in _COLUMNS or (key.startswith((_OVER, _P)) and "." not in key)
        if section == self.name and controller and known:
            return _measured(controller, key)
        return super().quantity(name)

    def shown(self, report: Report) -> Mapping[str, Section]:
        rows = report.sections.get(TITLE)
        study = _study(report.provenance["protocol"])
        if rows is None or study is None:
            return {}
        measures = measures_of({TITLE: rows})
        own = str((report.policy or {}).get("name"))
        names = {line.name: (line.controller or f"{own} (run)") + line.late for line in _lines(study)}
        handed = {name: name for name, _ in study.controllers}
        columns = _played(_HANDOVER_COLUMNS, study)
        tables = [
            _table("From the event on", names, _DYNAMIC_COLUMNS, measures, f"{_selection(report)} {NOTE}"),
            _table("Handover and event apart", handed, columns, measures, HANDOVER_NOTE),
        ]
        pairs = list(combinations(handed, 2))
        if pairs:
            cells = [
                (
                    f"{first} - {second}",
                    Cell(measures[f"continue.{first}.{_OVER}{second}"], Change()),
                    Cell(measures[f"continue.{first}.{_P}{second}"], MEASURE),
                )
                for first, second in pairs
            ]
            tables.append(
                Table("Dynamic, controllers with each other", ("Contrast", "Change", "p"), cells, P_NOTE)
            )
        return {TITLE: Section(tables=[table.explaining_intervals(INTERVAL_NOTE) for table in tables])}


def _selection(report: Report) -> str:
    pairs = measures_of(report.sections)[PAIRS.key].value or 0
    return (
        f"Over the {pairs:g} of {counted(report.pairs.played, 'pair')} in which the event happened; in the "
        "others no controller takes over."
    )


def _study(protocol: Json) -> Continue | None:
    """Return the study of a run from its header; None for another one."""
    spelled = protocol.get("study") or {}
    return Continue.of(spelled.get("settings")) if spelled.get("name") == Continue.name else None


class _Line(NamedTuple):
    """A row of the tables: the run's policy or a controller, perhaps with late answers."""

    controller: str | None
    """Name of the controller; None for the run's policy."""
    late: str = ""
    """End of the name of its arm where answers come late, for example ``_d4``."""

    @property
    def name(self) -> str:
        """Name in gates."""
        return (self.controller or RUN) + self.late

    @property
    def columns(self) -> dict[str, _Column]:
        """The columns that it can have."""
        if self.controller is None:
            columns = {key: _DYNAMIC_COLUMNS[key] for key in ("success", "change")}
            return {key: column._replace(arm=DYNAMIC + self.late) for key, column in columns.items()}
        if self.late:
            over = _DYNAMIC_COLUMNS["over_run"]._replace(less=DYNAMIC + self.late)
            return {**_DYNAMIC_COLUMNS, "over_run": over}
        return _COLUMNS


def _lines(study: Continue) -> list[_Line]:
    names = [None, *(name for name, _ in study.controllers)]
    ends = ["", *(f"_d{latency.steps}" for latency in study.latencies)]
    return [_Line(name, end) for end in ends for name in names]


def _measured(name: str, key: str) -> Measured:
    column = _COLUMNS.get(key)
    if column is not None:
        unit = "share" if column.less is None else "change"
        return Measured(
            f"continue.{name}.{key}", f"{name}: {column.title}", unit, of_change=key != "own_base"
        )
    contrast = f"{name} - {key.removeprefix(_P).removeprefix(_OVER)}"
    title, unit = (f"{contrast}, adjusted p", "p") if key.startswith(_P) else (contrast, "change")
    return Measured(f"continue.{name}.{key}", title, unit, of_change=True)


def _ends(records: Sequence[PairRecord], *arms: str) -> list[tuple[bool, ...]]:
    """Return success in these arms, of the cases that were played in all of them."""
    return [
        tuple(bool(record.arms[arm].success) for arm in arms)
        for record in records
        if {*arms} <= record.arms.keys()
    ]


def _number(name: str, key: str, column: _Column, records: Sequence[PairRecord]) -> Rows:
    measured = _measured(name, key)
    if column.less is None:
        return measured.share(end for (end,) in _ends(records, column.arm.format(name)))
    ends = _ends(records, column.less.format(name), column.arm.format(name))
    return measured.change([first for first, _ in ends], [second for _, second in ends])


def _contrasts(study: Continue, played: PlayedPairs) -> Rows:
    rows: Rows = {}
    pairs = list(combinations([name for name, _ in study.controllers], 2))
    ends = {pair: _ends(played.records, *(f"{DYNAMIC}_{name}" for name in reversed(pair))) for pair in pairs}
    tests = [
        mcnemar(both.count((True, False)), both.count((False, True))) if played.with_intervals else None
        for both in ends.values()
    ]
    for (pair, both), log10_p in zip(ends.items(), holm(tests), strict=True):
        first, second = pair
        change = _measured(first, _OVER + second).change(
            [reference for reference, _ in both], [compared for _, compared in both]
        )
        rows |= change | _measured(first, _P + second).row(None if log10_p is None else 10**log10_p)
    return rows


def _table(
    title: str,
    names: Mapping[str, str],
    columns: Mapping[str, _Column],
    measures: Mapping[str, Any],
    note: str,
) -> Table:
    """Return a table with a row for each name; a row has an empty cell where it has no such number."""

    def cell(name: str, key: str, column: _Column) -> Cell | str:
        measure = measures.get(f"continue.{name}.{key}")
        return "" if measure is None else Cell(measure, Counts() if column.less is None else Change())

    cells = [
        (shown, *(cell(name, key, column) for key, column in columns.items()))
        for name, shown in names.items()
    ]
    head = ("Controller", *(column.title for column in columns.values()))
    return Table(title, head, cells, note)
