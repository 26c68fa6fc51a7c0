"""A comparison of restoration modes as plain lines for the terminal."""

from __future__ import annotations

from pytest_libero_max.report.blocks import Ratio
from pytest_libero_max.report.formats import count_text, interval_text, percent, points
from pytest_libero_max.report.studies.recovery_document import Effect, Group, Recovery
from pytest_libero_max.stats.clusters import LEAST_CHANGED_TASKS, LEAST_TASKS

_QUANTITIES = {"dynamic": "Dynamic gain", "base": "Base gain", "closure": "Gap closure"}


def recovery_lines(recovery: Recovery) -> list[str]:
    """Render what :func:`.recovery.compare_recovery` returned."""
    policy, pairs = recovery.policy, recovery.pairs
    unsupported = max(pairs.unsupported.values(), default=0)
    left = f", {unsupported} of them unsupported by the policy" if unsupported else ""
    name = f"{policy['name']} (H={policy['horizon']} Q={policy['query_interval']})"
    lines = [
        f"Recovery: {name} on {recovery.substrate}, {recovery.case_set}",
        f"{pairs.common} common cases of {pairs.planned} planned{left}",
        "",
        f"{'':8}{'Base':>17}{'Dynamic':>17}{'Active, Base':>18}{'after the event':>18}{'ms a query':>12}",
    ]
    for mode, row in recovery.modes.items():
        active = [_rate(row.active.base), _rate(row.active.dynamic)]
        cost = row.seconds_per_query
        lines.append(
            f"{mode:8}{_rate(row.base):>17}{_rate(row.dynamic):>17}{active[0]:>18}{active[1]:>18}"
            f"{'-' if cost is None else f'{1000 * cost:.1f}':>12}"
        )
    lines += ["", f"{'':34}{'pp':>7}  {'exact':16}{'bootstrap':16}gained, lost"]
    for effect in recovery.effects:
        name = f"{effect.mode} - {effect.over}: {_QUANTITIES[effect.quantity]}"
        lines.append(f"{name:34}{_numbers(effect)}")
    lines += ["", "Dynamic gain by group"]
    for group in recovery.groups:
        name = f"{group.mode}, {group.name} ({group.pairs})"
        lines.append(f"{name:34}{_numbers(group)}")
    lines += [
        "",
        "Gap closure is the Dynamic gain less the Base gain. Intervals: 95%, pointwise; exact for two",
        "conditions; the paper's bootstrap, stratified by source category and clustered by configuration, is",
        f"too narrow where few cases changed, and n/a with fewer than {LEAST_TASKS} configurations or fewer",
        f"than {LEAST_CHANGED_TASKS} in which a case changed.",
        "Times are of judging and restoring alone; they are no statement on the speed of an episode.",
    ]
    return lines


def _rate(ratio: Ratio | None) -> str:
    return "-" if ratio is None else f"{percent(ratio.value)} {count_text(ratio)}"


def _numbers(row: Effect | Group) -> str:
    ends = interval_text(row.exact, signed=True), interval_text(row, signed=True)
    return f"{points(row.value):>7}  {ends[0]:16}{ends[1]:16}{row.gained}, {row.lost}"
