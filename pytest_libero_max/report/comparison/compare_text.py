"""A comparison of runs as plain lines for the terminal."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import PurePath
from textwrap import wrap
from typing import Any

import msgspec
from msgspec.structs import replace

from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.blocks import Result
from pytest_libero_max.report.comparison.comparison_document import (
    ApartRun,
    ChangeContrast,
    ComparedRun,
    Comparison,
    EventContrasts,
    GroupContrast,
    GroupDifference,
    RunDifference,
    SuccessContrast,
)
from pytest_libero_max.report.formats import PairCount, count_text, interval_text, p_number, percent, points
from pytest_libero_max.report.writers.summary import substrate_lines
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.stats.intervals import Interval
from pytest_libero_max.stats.verdicts import WORDS, word_for

AnyContrast = SuccessContrast | ChangeContrast | GroupContrast

_SHORT = dict(zip(OUTCOMES, ("(1,1)", "(0,1)", "(1,0)", "(0,0)"), strict=True))

_MOST_EVENT_CONTRASTS = 1
"""With more pairs of runs, contrasts by event are counted instead of listed."""

_LEVEL = 0.05

_MOST_NAMES = 4
"""Number of runs whose names are in a title."""

_NAMES = ("name", "first", "second")
"""Fields that hold the name of a run."""

OPEN_RANKS = "Open: the ranks that the simultaneous intervals of Dynamic success below do not exclude."

_SIMULTANEOUS = "simultaneous 95%"

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
        names = f"Comparison of {len(others) + 1} runs"
    return f"{names} on {comparison.pairs.common} common cases"


def result_lines(comparison: Comparison, flips: int = 20) -> list[str]:
    """Render the results of a comparison.

    Args:
        comparison: Result of :func:`~pytest_libero_max.report.comparison.compare.compare_runs`.
        flips: Number of changed cases to list.
    """
    changed = len(comparison.flips)
    comparison = with_short_names(replace(comparison, flips=comparison.flips[:flips]))
    pairs, runs = comparison.pairs, comparison.runs
    lines = [f"{len(runs)} runs on {pairs.common} common cases"]
    if pairs.restricted:
        left_out = ", ".join(f"{len(cases)} of {name}" for name, cases in pairs.left_out.items())
        lines = [f"RESTRICTED to {pairs.common} common cases; left out: {left_out}"]
    unsupported = ", ".join(f"{count} by {name}" for name, count in pairs.unsupported.items() if count)
    if unsupported:
        lines.append(f"Unsupported cases: {unsupported}. Runs that do not support all cases have no rank.")
    lines += substrate_lines(comparison.substrate)
    lines += difference_lines(comparison.differences)
    lines += ["", *_run_rows(comparison)]
    lines.append(OPEN_RANKS)
    lines += _apart_lines(comparison.apart)
    lines += ["", *_contrast_lines("Dynamic success", comparison.contrasts)]
    lines += ["", *_contrast_lines("Base success", comparison.base_contrasts)]
    lines += ["", *_contrast_lines("Paired change", comparison.change_contrasts)]
    lines += wrap(MEANINGS, 100)
    lines += ["", *_event_lines(comparison.by_event)]
    lines += ["", *_profile_lines(comparison)]
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
        f"{second} against {first}, on {comparison.pairs.common} common cases",
        *difference_lines(comparison.differences),
        *_run_rows(comparison),
        *_contrast_lines("Dynamic success", comparison.contrasts),
        *_flip_lines(comparison, changed)[: 1 + flips],
        f"More: {more}",
    ]


def _run_rows(comparison: Comparison) -> list[str]:
    runs = comparison.runs
    lines = [_run_row("rank", "open", "run", "Base", "Dynamic", "change [95%]", "95% by task", "lost")]
    lines += [
        _run_row(
            rank_text(run),
            rank_set_text(run),
            run.name,
            percent(run.base_success.value),
            percent(run.dynamic_success.value),
            f"{points(run.paired_change.value)} {interval_text(run.paired_change, signed=True)}",
            interval_text(run.paired_change.by_task, signed=True),
            count_text(run.conditional_regression),
        )
        for run in sorted(runs, key=lambda run: run.rank or len(runs) + 1)
    ]
    return lines


APART = (
    "Listed apart: policies that do not support all suites of the others. Their rows are over the cases that "
    "they support, and they change nothing else here. --restrict compares all runs on the cases they share."
)


def apart_rows(run: ApartRun) -> Iterator[tuple[str, Result | None]]:
    """Yield the rows of a run that is listed apart: by suite, and over all that its policy supports.

    A suite that it does not support has no result.
    """
    rows = {**run.by_suite, **dict.fromkeys(run.unsupported_suites)}
    yield from sorted(rows.items())
    yield "all supported", run.result


def apart_cells(name: str, row: Result | None) -> tuple[str, ...]:
    """Return the cells of such a row: name, pairs, Base, Dynamic and paired change."""
    if row is None:
        return (name, "unsupported", "n/a", "n/a", "n/a")
    change = f"{points(row.paired_change.value)} {interval_text(row.paired_change, signed=True)}"
    rates = (percent(row.base_success.value), percent(row.dynamic_success.value))
    return (name, PairCount().short(row), *rates, change)


def _apart_lines(runs: Sequence[ApartRun]) -> Iterator[str]:
    """Yield the runs that are listed apart, by suite as in the paper."""
    if not runs:
        return
    yield from ("", *wrap(APART, 100))
    for run in runs:
        head = (run.name, "pairs", "Base", "Dynamic", "change [95%]")
        rows = (apart_cells(f"  {name}", row) for name, row in apart_rows(run))
        for name, pairs, base, dynamic, change in (head, *rows):
            yield f"{name:<36} {pairs:>12} {base:>7} {dynamic:>7} {change:>24}"


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


def _run_row(
    rank: str, ranks: str, name: str, base: str, dynamic: str, change: str, by_task: str, lost: str
) -> str:
    return f"{rank:>4} {ranks:>6}  {name:<22} {base:>6} {dynamic:>7} {change:>24} {by_task:>15} {lost:>11}"


def difference_lines(differences: Sequence[RunDifference]) -> Iterator[str]:
    """Yield the differences between the runs beside their policies."""
    for difference in differences:
        values = ", ".join(f"{name} {value}" for name, value in difference.values.items())
        yield f"WARNING: the runs differ in {difference.field}: {values}"
    if differences:
        yield "WARNING: the contrasts below are of these differences and of the policies together."


def _contrast_lines(title: str, contrasts: Sequence[AnyContrast]) -> Iterator[str]:
    interval = _SIMULTANEOUS if len(contrasts) > 1 else "95% interval"
    yield _row(f"{title}, second against first", "change", interval, "95% by task", "Holm p") + "  verdict"
    for contrast in contrasts:
        word = verdict_of(contrast, len(contrasts))
        yield _contrast_line(contrast, names_of(contrast)) + (f"  {word}" if word else "")
    if len(contrasts) > 1:
        yield from wrap(
            f"All {len(contrasts)} intervals together hold the differences with 95% (Bonferroni). Holm's p "
            "is corrected for as many tests and is a little sharper: it may be below 0.05 where the "
            "interval still holds 0.",
            100,
        )


def names_of(contrast: AnyContrast) -> str:
    """Return the names of the two runs of a contrast, the second one first."""
    return f"{contrast.second} against {contrast.first}"


MEANINGS = f"Verdicts: {'; '.join(f'{word}, {meaning}' for word, meaning in WORDS.items())}."


def verdict_of(contrast: AnyContrast, family: int) -> str:
    """Return the word for a contrast of one of so many; empty where there is no interval."""
    found, log10_p = contrast.difference.simultaneous, contrast.log10_p_value_holm
    if found is None or found.lower is None or found.upper is None or log10_p is None:
        return ""
    differing = None
    if isinstance(contrast, SuccessContrast):
        differing = contrast.first_only + contrast.second_only
    return word_for(log10_p, Interval(found.lower, found.upper), differing, comparisons=family)


def _contrast_line(contrast: AnyContrast, label: str) -> str:
    difference, log10_p = contrast.difference, contrast.log10_p_value_holm
    by_task = None if isinstance(difference, GroupDifference) else difference.by_task
    return _row(
        label,
        points(difference.value),
        interval_text(difference.simultaneous, signed=True),
        interval_text(by_task, signed=True) if by_task is not None else "",
        "n/a" if log10_p is None else p_number(log10_p),
    )


def _row(names: str, change: str, interval: str, by_task: str, p_value: str) -> str:
    return f"{names:<40} {change:>7} {interval:>17} {by_task:>15} {p_value:>8}"


def _event_lines(by_event: Mapping[str, EventContrasts]) -> Iterator[str]:
    """Contrasts by event: listed for few runs, counted for many."""
    quantities: tuple[tuple[str, Callable[[EventContrasts], list[GroupContrast]]], ...] = (
        ("Dynamic success", lambda contrasts: contrasts.dynamic_success),
        ("Paired change", lambda contrasts: contrasts.paired_change),
    )
    for title, quantity in quantities:
        by_name = {event: quantity(contrasts) for event, contrasts in by_event.items()}
        few = all(len(contrasts) <= _MOST_EVENT_CONTRASTS for contrasts in by_name.values())
        if few:
            yield _row(f"{title} by event", "change", _SIMULTANEOUS, "", "Holm p")
        else:
            yield f"{title} by event: contrasts with Holm p < {_LEVEL:g}"
        for event, contrasts in by_name.items():
            if few:
                for contrast in contrasts:
                    single = len(contrasts) == 1
                    yield _contrast_line(contrast, event if single else f"{event}: {names_of(contrast)}")
            else:
                found = sum(10 ** (contrast.log10_p_value_holm or 0.0) < _LEVEL for contrast in contrasts)
                yield f"  {event:<24} {found} of {len(contrasts)}"
    yield "Holm's correction and the simultaneous intervals are over all events and pairs of runs."


def _profile_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the event of the lowest paired change of each run, and the agreement of the runs."""
    if len(comparison.by_event) > 1:
        yield f"{'Lowest paired change of an event':<34} {'value':>7} {'by chance':>10}  event"
        for run in comparison.runs:
            lowest = run.lowest_event
            yield (
                f"  {run.name:<32} {points(lowest.value):>7} {points(lowest.by_chance):>10}  "
                f"{lowest.event or 'none stands out'}"
            )
    if len(comparison.runs) > 2:
        yield f"{'Paired change by event':<28} {'median':>7}  quartiles over the runs  range"
        for event, over_runs in comparison.events.items():
            quartiles, ends = (
                f"[{points(low)}, {points(high)}]"
                for low, high in (
                    (over_runs.lower_quartile, over_runs.upper_quartile),
                    (over_runs.lowest, over_runs.highest),
                )
            )
            yield f"  {event:<26} {points(over_runs.median):>7}  {quartiles:<23}  {ends}"
    profiles = comparison.event_profiles
    if profiles.mean_spearman is None:
        yield "Agreement of the event profiles: n/a, no two runs have profiles that vary"
    else:
        yield (
            f"Agreement of the event profiles (Spearman): mean {profiles.mean_spearman:.2f}, from "
            f"{profiles.lowest:.2f} to {profiles.highest:.2f} over the pairs of runs"
        )


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
    lines.append("To play one of them again, append its name:")
    return [*lines, *(f"  {run.name}: {replay_text(run.replay)}" for run in comparison.runs)]
