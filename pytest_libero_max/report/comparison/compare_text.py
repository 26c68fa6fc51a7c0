"""A comparison of runs as plain lines for the terminal."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from textwrap import wrap
from typing import Any

import msgspec
from msgspec.structs import replace

from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.comparison.compare_tables import (
    APART,
    apart_tables,
    contrast_table,
    contrast_tables,
)
from pytest_libero_max.report.comparison.comparison_document import ComparedRun, Comparison, RunDifference
from pytest_libero_max.report.comparison.run_notes import caveat_names, warnings_by_run
from pytest_libero_max.report.formats import count_text, counted, interval_text, percent, points
from pytest_libero_max.report.table import Table, aligned
from pytest_libero_max.report.writers.summary import substrate_lines
from pytest_libero_max.runs.comparability import policies_text
from pytest_libero_max.runs.replay_command import replay_text

_SHORT = dict(zip(OUTCOMES, ("(1,1)", "(0,1)", "(1,0)", "(0,0)"), strict=True))

_MOST_NAMES = 4
"""Number of runs whose names are in a title."""

_NAMES = ("name", "first", "second")
"""Fields that hold the name of a run."""

OPEN_RANKS = "Open: the ranks that the simultaneous intervals of Dynamic success below do not exclude."

_STATEMENTS = ("generalisation", "interval", "policies", "behaviour")
"""Statements that the terminal shows; the files of a comparison hold all of them."""


def comparison_lines(comparison: Comparison, flips: int = 20) -> list[str]:
    """Render a comparison for the terminal: its results, and the statements that concern it most.

    Args:
        comparison: Result of :func:`~pytest_libero_max.report.comparison.compare.compare_runs`.
        flips: Number of changed cases to list.
    """
    lines = [*result_lines(comparison, flips), ""]
    for key in _STATEMENTS:
        lines += wrap(comparison.statements[key], 100)
    return lines


def comparison_title(comparison: Comparison) -> str:
    """Return a title: the names of the runs, or their number where they are many, and the number of cases."""
    *others, last = [run.name for run in with_short_names(replace(comparison, flips=[])).runs]
    names = f"{', '.join(others)} and {last}"
    if len(others) + 1 > _MOST_NAMES:
        names = f"Comparison of {counted(len(others) + 1, 'run')}"
    return f"{names} on {counted(comparison.pairs.common, 'common case')}"


def result_lines(comparison: Comparison, flips: int = 20) -> list[str]:
    """Render the results of a comparison.

    Args:
        comparison: Result of :func:`~pytest_libero_max.report.comparison.compare.compare_runs`.
        flips: Number of changed cases to list.
    """
    changed = len(comparison.flips)
    comparison = with_short_names(replace(comparison, flips=comparison.flips[:flips]))
    lines = [f"{counted(len(comparison.runs), 'run')} on {counted(comparison.pairs.common, 'common case')}"]
    lines += substrate_lines(comparison.substrate)
    lines += warning_lines(comparison)
    lines += caveat_lines(comparison)
    lines += ["", *_run_rows(comparison)]
    lines.append(OPEN_RANKS)
    if comparison.apart:
        lines += ["", *wrap(APART, 100)]
        for table in apart_tables(comparison.apart):
            lines += aligned([table.head, *table.rows], numbers=True)
    for table in contrast_tables(comparison):
        lines += ["", *_table_lines(table)]
    return [*lines, "", *_flip_lines(comparison, changed)]


def short_lines(comparison: Comparison, flips: int = 5) -> list[str]:
    """Render the end of a run that is compared with an earlier one: rates, Dynamic success, changed cases.

    Args:
        comparison: Of two runs, the earlier one first.
        flips: Number of changed cases to list.
    """
    changed = len(comparison.flips)
    command = ["libero-max", "compare", *(["--restrict"] if comparison.pairs.restricted else [])]
    more = shlex.join([*command, *(run.name for run in comparison.runs)])
    comparison = with_short_names(replace(comparison, flips=comparison.flips[:flips]))
    first, second = (
        f"{run.name} ({run.policy['name']})" if run.policy else run.name for run in comparison.runs
    )
    return [
        f"{second} against {first}, on {counted(comparison.pairs.common, 'common case')}",
        *warning_lines(comparison),
        *caveat_lines(comparison),
        *_run_rows(comparison),
        *_table_lines(contrast_table("Dynamic success", comparison.contrasts)),
        *_flip_lines(comparison, changed)[: 1 + flips],
        f"More: {more}",
    ]


def _run_rows(comparison: Comparison) -> list[str]:
    runs = comparison.runs
    rows = [
        (
            run.name,
            rank_text(run),
            rank_set_text(run),
            percent(run.base_success.value),
            percent(run.dynamic_success.value),
            f"{points(run.paired_change.value)} {interval_text(run.paired_change, signed=True)}",
            interval_text(run.paired_change.by_task, signed=True),
            count_text(run.conditional_regression),
        )
        for run in sorted(runs, key=lambda run: run.rank or len(runs) + 1)
    ]
    head = ("run", "rank", "open", "Base", "Dynamic", "change [95%]", "95% by task", "lost")
    return aligned([head, *rows], numbers=True)


def _table_lines(table: Table) -> list[str]:
    """Return a table with its title above and its note below."""
    return [table.title, *aligned([table.head, *table.rows], numbers=True), *wrap(table.note, 100)]


def with_short_names(comparison: Comparison) -> Comparison:
    """Return the comparison with runs named by the last part of their paths, where these differ."""
    names = [*(run.name for run in comparison.runs), *(run.name for run in comparison.apart)]
    short = dict(zip(names, (PurePath(name).name for name in names), strict=True))
    if len(set(short.values())) < len(names) or "" in short.values():
        return comparison

    def renamed(value: Any) -> Any:
        if isinstance(value, dict):
            return {
                short.get(key, key): (
                    short.get(item, item) if key in _NAMES and isinstance(item, str) else renamed(item)
                )
                for key, item in value.items()
            }
        return [renamed(item) for item in value] if isinstance(value, list) else value

    flips = [replace(flip, outcomes=renamed(flip.outcomes)) for flip in comparison.flips]
    shown = msgspec.convert(renamed(msgspec.to_builtins(replace(comparison, flips=[]))), Comparison)
    return replace(shown, flips=flips)


def rank_text(run: ComparedRun) -> str:
    """Return the rank of a run; two hyphens for none."""
    return "--" if run.rank is None else f"{run.rank:g}"


def rank_set_text(run: ComparedRun) -> str:
    """Return the ranks that the cases leave open to a run; two hyphens for none."""
    if run.highest_rank == run.lowest_rank:
        return "--" if run.highest_rank is None else str(run.highest_rank)
    return f"{run.highest_rank}-{run.lowest_rank}"


def comparison_warnings(comparison: Comparison) -> list[str]:
    """Return a sentence for each limit: cases that are not compared, differences, and each run's own."""
    pairs = comparison.pairs
    warnings = [*left_out_text(pairs.common, pairs.left_out)]
    unsupported = ", ".join(f"{count} by {name}" for name, count in pairs.unsupported.items() if count)
    if unsupported:
        warnings.append(f"Unsupported cases: {unsupported}. Runs that do not support all cases have no rank.")
    warnings += difference_warnings(comparison.differences)
    policies = policies_text(difference.field for difference in comparison.policies)
    return [*warnings, *filter(None, [policies]), *warnings_by_run(comparison)]


def warning_lines(comparison: Comparison) -> list[str]:
    """Return the warnings as lines for the terminal."""
    return [f"WARNING: {text}" for text in comparison_warnings(comparison)]


def caveat_lines(comparison: Comparison) -> list[str]:
    """Return the names of the caveats of each run as lines for the terminal."""
    return [line for text in caveat_names(comparison) for line in wrap(text, 100)]


def left_out_text(common: int, left_out: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield a sentence about the cases of each run that are not compared, where there are some."""
    counts = ", ".join(f"{len(cases)} of {name}" for name, cases in left_out.items() if cases)
    if counts:
        yield f"Restricted to {counted(common, 'common case')}; left out: {counts}."


def difference_warnings(differences: Sequence[RunDifference]) -> Iterator[str]:
    """Yield a sentence for each difference between the runs beside their policies, and one about all."""
    for difference in differences:
        values = ", ".join(f"{name} {value}" for name, value in difference.values.items())
        yield f"The runs differ in {difference.field}: {values}."
    if differences:
        yield "A difference between the results is of these differences and of the policies together."


def _flip_lines(comparison: Comparison, changed: int) -> list[str]:
    """Return the changed cases that are listed, and the number of all."""
    flips = comparison.flips
    if not changed:
        return ["No case changed."]
    names = [run.name for run in comparison.runs]
    lines = [f"{changed} case{'s' * (changed > 1)} changed, (Base, Dynamic) in {', '.join(names)}:"]
    for flip in flips:
        lines.append(f"{' '.join(_SHORT[flip.outcomes[name]] for name in names)}  {flip.item_id}")
    if changed > len(flips):
        lines.append(f"... and {changed - len(flips)} more")
    lines.append(
        "To play one of them again, append its name (commands as the folders of the runs name them):"
    )
    return [*lines, *(f"  {run.name}: {replay_text(run.replay)}" for run in comparison.runs)]
