"""One policy on old and on new cases: success on the old less success on the new ones, within cells.

The cases of a frozen track can be learnt, those of a draw that was made later cannot. A policy that is able
succeeds on both alike; one that was fitted to the old cases loses on the new ones. No case is the partner of
another here: those of a cell (source, event, variant) are independent samples of one population.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pytest_libero_max.errors import ReportError
from pytest_libero_max.report.build import group_order
from pytest_libero_max.report.document import Document, Section, table_of
from pytest_libero_max.report.formats import Interval, LogP, Share, Tenths, counted, percent, points
from pytest_libero_max.report.quantities import Quantity
from pytest_libero_max.runs.comparability import (
    COMPARISON,
    HERE,
    THERE,
    differences_between,
    is_file,
    listed,
    policy_differences,
)
from pytest_libero_max.runs.outcomes import RunOutcomes
from pytest_libero_max.runs.plan import PlannedPair, unsupported_pairs
from pytest_libero_max.stats.ratios import Ratio
from pytest_libero_max.stats.significance import holm
from pytest_libero_max.stats.two_proportions import StratifiedDifference, stratified_difference

ARMS = ("Base", "Dynamic")
_LEVEL = 0.05

_MAY_DIFFER = ("case_set", "renderers", "versions")
"""Settings in which the runs may differ, apart from the version of MuJoCo."""


class Cell(NamedTuple):
    """Cases that are samples of one population."""

    source: str
    event: str
    variant: int


@dataclass(frozen=True)
class Row:
    """Success in one arm."""

    old: Ratio
    new: Ratio
    difference: StratifiedDifference
    """Old less new, within cells."""
    adjusted_log10_p: float | None = None
    """Decimal logarithm of the p-value, adjusted for both arms; None for a single event."""

    @property
    def fitted(self) -> bool:
        """True if it is shown that the old cases are easier for the policy."""
        return (
            self.adjusted_log10_p is not None
            and 10**self.adjusted_log10_p < _LEVEL
            and self.difference.value > 0
        )


@dataclass(frozen=True)
class OldLessNew:
    """Comparison of a policy on old and new cases."""

    names: tuple[str, str]
    """Case sets of the old and of the new run."""
    cells: int
    """Number of cells with cases in both."""
    left_out: int
    """Cases in cells that only one of the runs has."""
    arms: Mapping[str, Row]
    """Both arms over all cells."""
    by_event: Mapping[str, Mapping[str, Row]]
    """Both arms by event."""


def old_less_new(old: RunOutcomes, new: RunOutcomes) -> OldLessNew:
    """Compare two complete runs of one policy on different cases.

    Raises:
        ReportError: The policies, the versions of MuJoCo or other settings are different ones, a run is
            incomplete, a case is in both, or no cell is.
    """
    _require_alike(old, new)
    sides = [_by_cell(run) for run in (old, new)]
    cells = sorted(sides[0].keys() & sides[1].keys())
    if not cells:
        raise ReportError(
            "No source, event and variant has cases in both runs. Play tracks of the same events."
        )
    events = sorted({cell.event for cell in cells}, key=lambda event: group_order("event", event))
    arms = {arm: _row(sides, cells, arm) for arm in ARMS}
    adjusted = zip(arms.items(), holm([row.difference.log10_p for row in arms.values()]), strict=True)
    return OldLessNew(
        names=(_case_set(old), _case_set(new)),
        cells=len(cells),
        left_out=sum(len(found) for side in sides for cell, found in side.items() if cell not in cells),
        arms={arm: replace(row, adjusted_log10_p=p) for (arm, row), p in adjusted},
        by_event={
            event: {arm: _row(sides, [cell for cell in cells if cell.event == event], arm) for arm in ARMS}
            for event in events
        },
    )


def _case_set(run: RunOutcomes) -> str:
    return str(run.run.provenance["case_set"]["name"])


def _require_alike(old: RunOutcomes, new: RunOutcomes) -> None:
    policies = [_policy(run) for run in (old, new)]
    if policies[0] != policies[1]:
        raise ReportError(
            f"The runs are of the policies {policies[0]} and {policies[1]}, but old less new is of one. Play "
            "one policy on both case sets."
        )
    sides = {THERE: old.side, HERE: new.side}
    if files := [one for one in policy_differences(sides) if is_file(one.field)]:
        raise ReportError(
            f"The policy has read other files: {listed(files)}, but old less new is of one policy. Play it "
            "with the same files, or declare PolicySpec(revision=...) where others are the same policy."
        )
    found = [
        one
        for one in differences_between(sides, COMPARISON)
        if one.field == "versions.mujoco" or not one.accepted(_MAY_DIFFER)
    ]
    if found:
        raise ReportError(
            f"The runs also differ in {listed(found)}, so that a difference is not of the cases alone. Play "
            "both alike."
        )
    for run in (old, new):
        missing = len(_playable(run)) - len(run.case_ids)
        if missing:
            raise ReportError(
                f"The run of {_case_set(run)} lacks {missing} of its planned pairs. Resume it first."
            )
    both = set(old.case_ids) & set(new.case_ids)
    if both:
        raise ReportError(
            f"The runs share {counted(len(both), 'case')}, for example {min(both)!r}, but old less new is of "
            "different cases. Give the run of a fresh draw second, or leave out --by-cell."
        )


def _policy(run: RunOutcomes) -> str:
    spec = run.policy or {}
    words = [spec.get("name"), spec.get("revision")]
    asks = f"(chunk of {spec.get('horizon')}, {spec.get('query_interval')} executed)"
    return " ".join(str(word) for word in (*words, asks) if word)


def _playable(run: RunOutcomes) -> dict[str, PlannedPair]:
    left_out = {pair.case_id for pair in unsupported_pairs(run.run.planned, run.policy)}
    return {pair.case_id: pair for pair in run.run.planned if pair.case_id not in left_out}


def _by_cell(run: RunOutcomes) -> dict[Cell, np.ndarray]:
    """Return (n, 2) outcomes of each cell, Base and Dynamic."""
    planned = _playable(run)
    found: dict[Cell, list[tuple[bool, bool]]] = {}
    for case_id, base, dynamic in zip(run.case_ids, run.pairs.base, run.pairs.dynamic, strict=True):
        pair = planned[case_id]
        found.setdefault(Cell(pair.source, pair.event, pair.variant), []).append((base, dynamic))
    return {cell: np.asarray(outcomes) for cell, outcomes in found.items()}


def _row(sides: list[dict[Cell, np.ndarray]], cells: list[Cell], arm: str) -> Row:
    column = ARMS.index(arm)
    ratios = [[Ratio(int(side[cell][:, column].sum()), len(side[cell])) for cell in cells] for side in sides]
    total = [Ratio(sum(one.count for one in row), sum(one.of for one in row)) for row in ratios]
    return Row(total[0], total[1], stratified_difference(list(zip(*ratios, strict=True))))


_QUANTITIES: tuple[Quantity[Row], ...] = (
    Quantity("old", "Old", lambda row: row.old, Share()),
    Quantity("new", "New", lambda row: row.new, Share()),
    Quantity("difference", "Old less new, pp", lambda row: row.difference.value, Tenths()),
    Quantity("interval", "score interval", lambda row: row.difference.interval, Interval()),
)
_ADJUSTED: Quantity[Row] = Quantity("p", "adjusted p", lambda row: row.adjusted_log10_p, LogP())


def document_of(result: OldLessNew) -> Document:
    """Return the comparison as a document."""
    old, new = result.names
    tables = [table_of("", "", (*_QUANTITIES, _ADJUSTED), result.arms.items())]
    for arm in ARMS:
        rows = [(event, rows[arm]) for event, rows in result.by_event.items()]
        tables.append(table_of(f"{arm}, by event (each interval for itself)", "", _QUANTITIES, rows))
    left_out = f"Left out: {counted(result.left_out, 'case')}, in cells that only one of the runs has."
    cells = counted(result.cells, "cell")
    return Document(
        f"Old less new: {old} less {new}, within {cells} of source, event and variant",
        sections=[
            Section(tables=tables),
            Section(texts=[*([left_out] if result.left_out else []), *_meaning(result)]),
        ],
    )


def _meaning(found: OldLessNew) -> Iterator[str]:
    fitted = [arm for arm, row in found.arms.items() if row.fitted]
    for arm in fitted:
        row = found.arms[arm]
        yield (
            f"{arm} is over-fitted: of {percent(row.old.value)} success on the old cases, "
            f"{points(row.difference.value)} pp are lost on new cases of the same cells."
        )
    for arm, row in found.arms.items():
        if arm not in fitted:
            most = max(0.0, row.difference.interval.upper)
            yield (
                f"{arm} shows no over-fitting: by the interval, at most {100 * most:.1f} pp of "
                f"{percent(row.old.value)} are lost on new cases."
            )
    yield "The intervals include the difference of the draws by chance; a policy that knows no case shows it."
