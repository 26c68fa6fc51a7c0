"""A comparison of restoration modes as a document."""

from __future__ import annotations

from pytest_libero_max.lab.recovery.recovery_document import Effect, Gain, Mode, Recovery
from pytest_libero_max.report.document import Document, Section, Table, table_of
from pytest_libero_max.report.formats import Interval, Number, Share, Tenths
from pytest_libero_max.report.quantities import TEXT, Cell, Quantity
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS

_QUANTITIES = {"dynamic": "Dynamic gain", "base": "Base gain", "closure": "Gap closure"}

_MODE: tuple[Quantity[Mode], ...] = (
    Quantity("base", "Base", lambda row: row.base, Share()),
    Quantity("dynamic", "Dynamic", lambda row: row.dynamic, Share()),
)

_GAIN: tuple[Quantity[Gain], ...] = (
    Quantity("gain", "pp", lambda row: row.value, Tenths()),
    Quantity("interval", "[95%]", lambda row: row, Interval()),
    Quantity("bootstrap", "bootstrap", lambda row: row.bootstrap, Interval()),
    Quantity("gained", "gained", lambda row: row.gained, TEXT),
    Quantity("lost", "lost", lambda row: row.lost, TEXT),
)

_NOTES = (
    "Gap closure is the Dynamic gain less the Base gain. Intervals: 95%, pointwise, for independent cases; "
    "the paper's bootstrap, stratified by source category and clustered by configuration, is too narrow "
    f"where few cases changed, and n/a with fewer than {LEAST_TASKS} configurations or fewer than "
    f"{LEAST_CHANGED_TASKS} in which a case changed.",
    "Times are of judging and restoring alone; they are no statement on the speed of an episode.",
)


def document_of(recovery: Recovery) -> Document:
    """Return what :func:`.recovery.compare_recovery` returned as a document."""
    policy, pairs = recovery.policy, recovery.pairs
    unsupported = max(pairs.unsupported.values(), default=0)
    left = f", {unsupported} of them unsupported by the policy" if unsupported else ""
    name = f"{policy['name']} (H={policy['horizon']} Q={policy['query_interval']})"
    modes = [
        (
            mode,
            *(one.cell(row) for one in _MODE),
            *(
                None if share is None else Cell(share, Share())
                for share in (row.active.base, row.active.dynamic)
            ),
            None if row.seconds_per_query is None else Cell(1000 * row.seconds_per_query, Number(".1f")),
        )
        for mode, row in recovery.modes.items()
    ]
    head: list[str | Quantity[Mode]] = ["Mode", *_MODE, "Active, Base", "after the event", "ms a query"]
    effects = [(_effect_name(row), row) for row in recovery.effects]
    groups = [(f"{row.mode}, {row.name} ({row.pairs})", row) for row in recovery.groups]
    return Document(
        f"Recovery: {name} on {recovery.substrate}, {recovery.case_set}",
        texts=[f"{pairs.common} common cases of {pairs.planned} planned{left}"],
        sections=[
            Section(tables=[Table("", head, modes)]),
            Section(tables=[table_of("", "Effect", _GAIN, effects)]),
            Section(tables=[table_of("", "Dynamic gain by group", _GAIN, groups)]),
            Section(texts=_NOTES),
        ],
    )


def _effect_name(row: Effect) -> str:
    return f"{row.mode} - {row.over}: {_QUANTITIES[row.quantity]}"
