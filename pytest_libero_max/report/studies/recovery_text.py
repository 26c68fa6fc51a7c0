"""A comparison of restoration modes as plain lines for the terminal."""

from __future__ import annotations

from pytest_libero_max.report.blocks import Ratio
from pytest_libero_max.report.formats import count_text, interval_text, percent, points
from pytest_libero_max.report.studies.recovery_document import Effect, Gain, Group, Mode, Recovery
from pytest_libero_max.report.table import aligned
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS

_QUANTITIES = {"dynamic": "Dynamic gain", "base": "Base gain", "closure": "Gap closure"}
_MODES = ("Mode", "Base", "Dynamic", "Active, Base", "after the event", "ms a query")
_EFFECTS = ("Effect", "pp", "[95%]", "bootstrap", "gained, lost")


def recovery_lines(recovery: Recovery) -> list[str]:
    """Render what :func:`.recovery.compare_recovery` returned."""
    policy, pairs = recovery.policy, recovery.pairs
    unsupported = max(pairs.unsupported.values(), default=0)
    left = f", {unsupported} of them unsupported by the policy" if unsupported else ""
    name = f"{policy['name']} (H={policy['horizon']} Q={policy['query_interval']})"
    return [
        f"Recovery: {name} on {recovery.substrate}, {recovery.case_set}",
        f"{pairs.common} common cases of {pairs.planned} planned{left}",
        "",
        *aligned([_MODES, *(_mode(mode, row) for mode, row in recovery.modes.items())], numbers=True),
        "",
        *aligned([_EFFECTS, *map(_effect, recovery.effects)], numbers=True),
        "",
        *aligned([("Dynamic gain by group", *_EFFECTS[1:]), *map(_group, recovery.groups)], numbers=True),
        "",
        "Gap closure is the Dynamic gain less the Base gain. Intervals: 95%, pointwise, for independent",
        "cases; the paper's bootstrap, stratified by source category and clustered by configuration, is",
        f"too narrow where few cases changed, and n/a with fewer than {LEAST_TASKS} configurations or fewer",
        f"than {LEAST_CHANGED_TASKS} in which a case changed.",
        "Times are of judging and restoring alone; they are no statement on the speed of an episode.",
    ]


def _rate(ratio: Ratio | None) -> str:
    return "-" if ratio is None else f"{percent(ratio.value)} {count_text(ratio)}"


def _mode(mode: str, row: Mode) -> tuple[str, ...]:
    cost = row.seconds_per_query
    rates = (row.base, row.dynamic, row.active.base, row.active.dynamic)
    return (mode, *map(_rate, rates), "-" if cost is None else f"{1000 * cost:.1f}")


def _effect(row: Effect) -> tuple[str, ...]:
    return (f"{row.mode} - {row.over}: {_QUANTITIES[row.quantity]}", *_numbers(row))


def _group(row: Group) -> tuple[str, ...]:
    return (f"{row.mode}, {row.name} ({row.pairs})", *_numbers(row))


def _numbers(row: Gain) -> tuple[str, ...]:
    ends = interval_text(row, signed=True), interval_text(row.bootstrap, signed=True)
    return (points(row.value), *ends, f"{row.gained}, {row.lost}")
