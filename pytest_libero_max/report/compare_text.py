"""A comparison of runs as plain lines for the terminal."""

from __future__ import annotations

import shlex

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.formats import count_text, interval_text, p_number, percent, points
from pytest_libero_max.report.summary import substrate_lines

_SHORT = dict(zip(OUTCOMES, ("(1,1)", "(0,1)", "(1,0)", "(0,0)"), strict=True))


def comparison_lines(comparison: Json, flips: int = 20) -> list[str]:
    """Render a comparison.

    Args:
        comparison: What :func:`~pytest_libero_max.report.compare.compare_runs` returned.
        flips: How many changed cases are listed.
    """
    pairs, runs = comparison["pairs"], comparison["runs"]
    lines = [f"{len(runs)} runs on {pairs['common']} common cases"]
    if pairs["restricted"]:
        left_out = ", ".join(f"{len(cases)} of {name}" for name, cases in pairs["left_out"].items())
        lines = [f"RESTRICTED to {pairs['common']} common cases; left out: {left_out}"]
    lines += substrate_lines(comparison["substrate"])
    lines += ["", f"{'rank':>4}  {'run':<26} {'Base':>8} {'Dynamic':>9} {'change':>9} {'lost':>8}"]
    lines += [
        f"{run['rank']:>4g}  {run['name']:<26} {percent(run['base_success']['value']):>8} "
        f"{percent(run['dynamic_success']['value']):>9} {points(run['paired_change']['value']):>9} "
        f"{count_text(run['conditional_regression']):>8}"
        for run in sorted(runs, key=lambda run: run["rank"])
    ]
    lines += [
        "",
        f"{'Dynamic success, second against first':<40} {'change':>8} {'95% interval':>16} {'Holm p':>9}",
    ]
    lines += [_contrast_line(contrast) for contrast in comparison["contrasts"]]
    return [*lines, "", *_flip_lines(comparison, flips)]


def _contrast_line(contrast: Json) -> str:
    difference, log10_p = contrast["difference"], contrast["log10_p_value_holm"]
    return _row(
        f"{contrast['second']} against {contrast['first']}",
        points(difference["value"]),
        interval_text(difference, signed=True),
        "n/a" if log10_p is None else p_number(log10_p),
    )


def _row(names: str, change: str, interval: str, p_value: str) -> str:
    return f"{names:<40} {change:>8} {interval:>16} {p_value:>9}"


def _flip_lines(comparison: Json, most: int) -> list[str]:
    flips = comparison["flips"]
    if not flips:
        return ["No case changed."]
    names = [run["name"] for run in comparison["runs"]]
    lines = [f"{len(flips)} cases changed, (Base, Dynamic) in {', '.join(names)}:"]
    for flip in flips[:most]:
        lines.append(f"{' '.join(_SHORT[flip['outcomes'][name]] for name in names)}  {flip['item_id']}")
    if len(flips) > most:
        lines.append(f"... and {len(flips) - most} more")
    lines.append("To play one of them again, append its name:")
    return [*lines, *(f"  {run['name']}: {shlex.join(run['replay'])}" for run in comparison["runs"])]
