"""A comparison of runs as a document for the terminal, Markdown and the page."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace as replaced
from pathlib import PurePath
from textwrap import wrap
from typing import Any

import msgspec
from msgspec.structs import replace

from pytest_libero_max.pairing.record import OUTCOMES
from pytest_libero_max.report.comparison.comparison_document import (
    ApartRun,
    ComparedRun,
    Comparison,
    OverRuns,
    RunDifference,
)
from pytest_libero_max.report.document import Document, Section, Table, table_of
from pytest_libero_max.report.formats import Interval, LogP, Number, Tenths, counted
from pytest_libero_max.report.quantities import TEXT, Quantity, quantities_in, quantity
from pytest_libero_max.report.render.terminal import WIDTH, section_lines, sections_lines
from pytest_libero_max.report.run_texts import substrate_lines
from pytest_libero_max.report.statements import CAVEATS_TITLE
from pytest_libero_max.runs.comparability import policies_text
from pytest_libero_max.runs.replay_command import replay_text
from pytest_libero_max.stats import intervals
from pytest_libero_max.stats.blocks import ChangeContrast, GroupContrast, Result, SuccessContrast
from pytest_libero_max.stats.significance import WORDS, word_for

AnyContrast = SuccessContrast | ChangeContrast | GroupContrast

_SHORT = dict(zip(OUTCOMES, ("(1,1)", "(0,1)", "(1,0)", "(0,0)"), strict=True))

_MOST_NAMES = 4
"""Number of runs whose names are in a title."""

_NAMES = ("name", "first", "second")
"""Fields that hold the name of a run."""

_STATEMENTS = ("generalisation", "interval", "policies", "behaviour")
"""Statements that the terminal shows; the files of a comparison hold all of them."""

_LISTED = 20
_LISTED_AT_THE_END = 5
_LEVEL = 0.05

_APART = (
    "Policies that do not support all suites of the others are listed apart. Their rows are over the cases "
    "that they support, and nothing else here uses them. --restrict compares all runs on their common cases."
)

_RANKS: tuple[Quantity[ComparedRun], ...] = (
    Quantity("rank", "Rank", lambda run: run.rank, Number("g", missing="--")),
    Quantity("possible_ranks", "Possible ranks (95%)", lambda run: _possible_ranks(run), TEXT),
)

RUNS = quantities_in("runs")
"""Quantities of a run beside those of other runs."""


def document_of(comparison: Comparison, flips: int = _LISTED) -> Document:
    """Return a comparison as a document."""
    changed = len(comparison.flips)
    shown = with_short_names(replace(comparison, flips=comparison.flips[:flips]))
    sections = [Section(tables=[_runs_table(shown)])]
    if shown.apart:
        sections.append(Section("Runs apart", [*map(_apart_table, shown.apart)], [_APART]))
    sections += [Section(tables=[table]) for table in _contrast_tables(shown)]
    return Document(
        comparison_title(comparison),
        comparison_warnings(shown),
        [shown.substrate.note] if shown.substrate.note else [],
        [*sections, _flips(shown, changed)],
        caveats_by_run(shown),
        [*shown.statements.values()],
    )


def comparison_lines(comparison: Comparison, flips: int = _LISTED) -> list[str]:
    """Render a comparison for the terminal: its results, and the statements that concern it most."""
    document = document_of(comparison, flips)
    lines = [*terminal_head(document, comparison), *sections_lines(document.sections)]
    shown = [comparison.statements[key] for key in _STATEMENTS if key in comparison.statements]
    return [*lines, "", *(line for text in shown for line in wrap(text, WIDTH))]


def terminal_head(document: Document, comparison: Comparison) -> list[str]:
    """Return title and warnings of a document for the terminal, which names the caveats of runs alone."""
    names = caveat_names(with_short_names(comparison))
    return [
        document.title,
        *substrate_lines(comparison.substrate),
        *(f"WARNING: {text}" for text in document.warnings),
        *(line for text in names for line in wrap(text, WIDTH)),
    ]


def short_lines(comparison: Comparison, flips: int = _LISTED_AT_THE_END) -> list[str]:
    """Render the end of a run that is compared with an earlier one: rates, Dynamic success, changed cases."""
    changed = len(comparison.flips)
    command = ["libero-max", "compare", *(["--restrict"] if comparison.pairs.restricted else [])]
    more = shlex.join([*command, *(run.name for run in comparison.runs)])
    shown = with_short_names(replace(comparison, flips=comparison.flips[:flips]))
    first, second = (f"{run.name} ({run.policy['name']})" if run.policy else run.name for run in shown.runs)
    runs = replaced(_runs_table(shown), note="")
    parts = [
        Section(tables=[runs, contrast_table("Dynamic success", shown.contrasts)]),
        _flips(shown, changed),
    ]
    return [
        f"{second} against {first}, on {counted(shown.pairs.common, 'common case')}",
        *(f"WARNING: {text}" for text in comparison_warnings(shown)),
        *(line for text in caveat_names(shown) for line in wrap(text, WIDTH)),
        *(line for part in parts for line in section_lines(part) if line),
        f"More: {more}",
    ]


def comparison_title(comparison: Comparison) -> str:
    """Return a title: the names of the runs, or their number where they are many, and the number of cases."""
    *others, last = [run.name for run in with_short_names(replace(comparison, flips=[])).runs]
    names = f"{', '.join(others)} and {last}"
    if len(others) + 1 > _MOST_NAMES:
        names = f"Comparison of {counted(len(others) + 1, 'run')}"
    return f"{names} on {counted(comparison.pairs.common, 'common case')}"


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
        yield "Do not credit the policies alone for a difference between the results."


def warnings_by_run(comparison: Comparison) -> list[str]:
    """Return the warnings of the runs, each with the names of the runs that it is about."""
    return _by_text((text, run.name) for run in _all_runs(comparison) for text in run.warnings)


def caveats_by_run(comparison: Comparison) -> list[str]:
    """Return the caveats of the runs in full, each with its runs and their numbers of pairs."""
    return _by_text(
        (caveat.text, f"{caveat.pairs} of {counted(caveat.played, 'pair')} of {run.name}")
        for run in _all_runs(comparison)
        for caveat in run.caveats
    )


def caveat_names(comparison: Comparison) -> list[str]:
    """Return for each run that has caveats a line with their keys and numbers of pairs."""
    return [
        f"{CAVEATS_TITLE} of {run.name} (in full in its report.md): "
        + ", ".join(f"{caveat.name} {caveat.pairs}" for caveat in run.caveats)
        for run in _all_runs(comparison)
        if run.caveats
    ]


def _all_runs(comparison: Comparison) -> list[ComparedRun | ApartRun]:
    return [*comparison.runs, *comparison.apart]


def _by_text(texts: Iterable[tuple[str, str]]) -> list[str]:
    """Return the texts, each once and behind the names that it is about."""
    found: dict[str, list[str]] = {}
    for text, name in texts:
        found.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in found.items()]


def _runs_table(comparison: Comparison) -> Table:
    by_task = quantity("paired_change_by_task")
    ranks = _RANKS if any(run.highest_rank for run in comparison.runs) else _RANKS[:1]
    return table_of(
        "", "Run", (*ranks, *RUNS[:-1], by_task, RUNS[-1]), [(run.name, run) for run in comparison.runs]
    )


def _possible_ranks(run: ComparedRun) -> str | int | None:
    if run.highest_rank == run.lowest_rank:
        return run.highest_rank
    return f"{run.highest_rank}-{run.lowest_rank}"


def _apart_table(run: ApartRun) -> Table:
    """Return a run that is listed apart: by suite, and over all that the policy supports, as in the paper.

    A suite that the policy does not support has no result.
    """
    quantities = (quantity("played"), *RUNS[:-1])
    by_suite: dict[str, Result | None] = {**run.by_suite, **dict.fromkeys(run.unsupported_suites)}
    results = [*sorted(by_suite.items()), ("all supported", run.result)]
    rows = [
        (name, "unsupported", *["n/a"] * (len(quantities) - 1))
        if row is None
        else (name, *(one.cell(row) for one in quantities))
        for name, row in results
    ]
    return Table("", (run.name, *quantities), rows)


def _contrast_tables(comparison: Comparison) -> Iterator[Table]:
    """Yield the contrasts of every two runs, those by event, and how far the runs agree about the events."""
    family = len(comparison.contrasts)
    notes = [
        "The test of a paired change assumes exchangeable runs. Its interval does not, so it may hold 0 "
        "where p is small.",
        f"Verdicts: {'; '.join(f'{word}, {meaning}' for word, meaning in WORDS.items())}.",
    ]
    if family > 1:
        notes.insert(
            0,
            f"All {family} intervals of a table hold together with 95% (Bonferroni). Holm's p is corrected "
            "for as many tests and a little sharper: it may be below 0.05 where the interval still holds 0.",
        )
    yield contrast_table("Dynamic success", comparison.contrasts)
    yield contrast_table("Base success", comparison.base_contrasts)
    changes = contrast_table("Paired change", comparison.change_contrasts)
    yield changes.explaining_intervals(" ".join(notes))
    yield from _by_event(comparison)
    yield from _profiles(comparison)


_DIFFERENCE: tuple[Quantity[AnyContrast], ...] = (
    Quantity("difference", "Difference, pp", lambda row: row.difference.value, Tenths()),
    Quantity("simultaneous", "Simultaneous 95%", lambda row: row.difference.simultaneous, Interval()),
)
_HOLM: Quantity[AnyContrast] = Quantity("holm_p", "Holm p", lambda row: row.log10_p_value_holm, LogP())
_BY_TASK: Quantity[SuccessContrast | ChangeContrast] = Quantity(
    "by_task", "95% by task", lambda row: row.difference.by_task, Interval()
)
_OVER_RUNS: tuple[Quantity[OverRuns], ...] = (
    Quantity("median", "Median, pp", lambda row: row.median, Tenths()),
    Quantity(
        "quartiles",
        "Quartiles",
        lambda row: _ends(row.lower_quartile, row.upper_quartile),
        Interval(),
    ),
    Quantity("range", "Range", lambda row: _ends(row.lowest, row.highest), Interval()),
)
_LOWEST: tuple[Quantity[ComparedRun], ...] = (
    Quantity("lowest", "Value, pp", lambda run: run.lowest_event.value, Tenths()),
    Quantity("by_chance", "By chance, pp", lambda run: run.lowest_event.by_chance, Tenths()),
    Quantity("lowest_event", "Event", lambda run: run.lowest_event.event or "none stands out", TEXT),
)


def _ends(lower: float, upper: float) -> intervals.Interval:
    return intervals.Interval(lower, upper)


def contrast_table(quantity: str, contrasts: Sequence[SuccessContrast | ChangeContrast]) -> Table:
    """Return the contrasts of every two runs in one quantity."""
    family = len(contrasts)
    verdict: Quantity[Any] = Quantity("verdict", "Verdict", lambda row: _verdict(row, family), TEXT)
    difference, simultaneous = _DIFFERENCE
    if family == 1:
        simultaneous = replaced(simultaneous, title="95%")
    columns = (difference, simultaneous, _BY_TASK, _HOLM, verdict)
    rows = [(f"{row.second} against {row.first}", row) for row in contrasts]
    return table_of(f"{quantity}, contrasts", "Second against first", columns, rows)


def _verdict(contrast: AnyContrast, family: int) -> str:
    interval, log10_p = contrast.difference.simultaneous, contrast.log10_p_value_holm
    if interval.lower is None or interval.upper is None or log10_p is None:
        return "n/a"
    differing = None
    if isinstance(contrast, SuccessContrast):
        differing = contrast.first_only + contrast.second_only
    return word_for(log10_p, _ends(interval.lower, interval.upper), differing, comparisons=family)


def _by_event(comparison: Comparison) -> Iterator[Table]:
    """Yield the contrasts by event: each for two runs, those with a small p counted for more."""
    note = "Holm's correction and the simultaneous intervals cover all events and pairs of runs."
    for title, field in (("Dynamic success", "dynamic_success"), ("Paired change", "paired_change")):
        rows: Sequence[tuple[str, list[GroupContrast]]] = [
            (event, getattr(contrasts, field)) for event, contrasts in comparison.by_event.items()
        ]
        heading = f"{title} by event, contrasts"
        if len(comparison.runs) == 2:
            single = [(event, contrast) for event, (contrast,) in rows]
            table = table_of(heading, "Event", (*_DIFFERENCE, _HOLM), single, dimension="event")
            yield table.explaining_intervals(note)
        else:
            small: Quantity[Any] = Quantity("small", f"Contrasts with Holm p < {_LEVEL:g}", _small, TEXT)
            yield table_of(heading, "Event", (small,), rows, note=note, dimension="event")


def _small(contrasts: Iterable[GroupContrast]) -> str:
    tested = [row.log10_p_value_holm for row in contrasts if row.log10_p_value_holm is not None]
    return f"{sum(10**log10_p < _LEVEL for log10_p in tested)} of {len(tested)}"


def _profiles(comparison: Comparison) -> Iterator[Table]:
    """Yield the paired changes by event over several runs, and the lowest one of each run."""
    if len(comparison.runs) > 2:
        title = "Paired change by event over the runs"
        yield table_of(title, "Event", _OVER_RUNS, comparison.events.items(), dimension="event")
    if len(comparison.by_event) > 1:
        profiles = comparison.event_profiles
        note = "Agreement of the event profiles: n/a, because no two runs have profiles that vary."
        if profiles.mean_spearman is not None:
            note = (
                f"Agreement of the event profiles (Spearman): mean {profiles.mean_spearman:.2f}, from "
                f"{profiles.lowest:.2f} to {profiles.highest:.2f} over the pairs of runs."
            )
        rows = [(run.name, run) for run in comparison.runs]
        yield table_of("Lowest paired change of an event", "Run", _LOWEST, rows, note=note)


def _flips(comparison: Comparison, changed: int) -> Section:
    if not changed:
        return Section(texts=["No case changed."])
    names = [run.name for run in comparison.runs]
    items = [
        f"{' '.join(_SHORT[flip.outcomes[name]] for name in names)}  {flip.item_id}"
        for flip in comparison.flips
    ]
    if changed > len(items):
        items.append(f"... {changed - len(items)} more")
    replay = [f"{run.name}: {replay_text(run.replay)}" for run in comparison.runs]
    return Section(
        f"{counted(changed, 'case')} changed, (Base, Dynamic) in {', '.join(names)}:",
        items=[
            *items,
            "To play one again, append its name to the command of a run:",
            *(f"  {command}" for command in replay),
        ],
    )
