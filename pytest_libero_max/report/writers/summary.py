"""The terminal summary: a report as one compact section of plain lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from textwrap import wrap
from typing import Any

from pytest_libero_max.report.broken import broken_line, broken_lines
from pytest_libero_max.report.connection import connection_texts
from pytest_libero_max.report.formats import change_text, counted, percent
from pytest_libero_max.report.groups import group_table
from pytest_libero_max.report.measurable import NOT_MEASURABLE, is_measurable, warning_of
from pytest_libero_max.report.measures import measure_text
from pytest_libero_max.report.quantities import QUANTITIES, Quantity
from pytest_libero_max.report.render.terminal import table_lines
from pytest_libero_max.report.report_document import Caveat, Report
from pytest_libero_max.report.run_texts import (
    clipping_text,
    incomplete_text,
    missing_text,
    repaired_text,
    stopped_texts,
    substrate_lines,
    title_text,
    unsupported_text,
)
from pytest_libero_max.report.sections import main_measures, section_warnings
from pytest_libero_max.report.studies.study_tables import study_lines
from pytest_libero_max.stats.blocks import Result

_WORDS = "What the words mean: libero-max list words"


def summary_lines(
    report: Report, paths: Sequence[str] = (), films: Mapping[str, str] | None = None, show: str | None = None
) -> list[str]:
    """Render a report for the terminal.

    Returns:
        Lines without line ends, at most 100 columns apart from names and paths longer than that.
    """
    pairs, overall = report.pairs, report.overall
    lines = [] if pairs.complete else [incomplete_text(pairs)]
    lines += [line for text in stopped_texts(pairs) for line in wrap(text, 100)]
    lines += _header(report)
    lines += wrap(unsupported_text(pairs) or "", 100)
    lines += wrap(repaired_text(pairs) or "", 100)
    lines += substrate_lines(report.substrate)
    lines += wrap(report.inference.text, 100)
    lines.append("")
    if pairs.played == 0:
        return [*lines, "No pair was played; there is nothing to report.", *_written(paths)]
    if not pairs.complete:
        lines.append(f"Over {counted(pairs.played, 'played pair')} only:")
    lines += wrap(warning_of(overall) or "", 100)
    lines += [line for text in section_warnings(report) for line in wrap(text, 100)]
    lines += [*_overall_lines(overall), *_section_lines(report)]
    lines += [line for text in connection_texts(report) for line in wrap(text, 100)]
    lines += ["", *_event_lines(report)]
    lines += [] if report.study is None else study_lines(report.study)
    lines += wrap(missing_text(report) or "", 100)
    lines += [*_caveat_lines(report.caveats), *wrap(clipping_text(report) or "", 100)]
    return [*lines, *broken_lines(report, films, show), _WORDS, *_written(paths)]


def quiet_lines(report: Report, paths: Sequence[str] = ()) -> list[str]:
    """Render a report for the terminal of a quiet run: the headline, its warning, what broke, the page."""
    pairs, overall = report.pairs, report.overall
    lines = [] if pairs.complete else [incomplete_text(pairs)]
    lines += stopped_texts(pairs)
    if pairs.played:
        rates = f"{percent(overall.base_success.value)} to {percent(overall.dynamic_success.value)}"
        change = change_text(overall.paired_change)
        lines += [
            f"{title_text(report)}: {f'{rates}, {change}' if is_measurable(overall) else rates}",
            *filter(None, [warning_of(overall)]),
            *section_warnings(report),
            broken_line(report),
        ]
    return [*lines, *_written([path for path in paths if path.endswith(".html")])]


def _overall_lines(overall: Result) -> Iterator[str]:
    shown = [
        (column, column.line)
        for column in QUANTITIES
        if column.line is not None and not (column.line.optional and _is_empty(column, overall))
    ]
    for title, group in groupby(shown, key=lambda cell: cell[1].title):
        cells, texts = [*group], []
        if cells[0][0].of_change and not is_measurable(overall):
            if cells[0][0].key == "paired_change":
                yield f"{title:<32}{NOT_MEASURABLE}"
            continue
        for column, line in cells:
            value = column.short(overall) if line.short else column.long(overall)
            texts.append(f"{line.mark} {value}".strip())
        yield f"{title:<32}{'   '.join(texts)}"


def _is_empty(column: Quantity[Any], row: Result) -> bool:
    return None in column.numbers(row).values()


def _event_lines(report: Report) -> list[str]:
    table = group_table("narrow", "Event", report.by["event"])
    return [*table_lines(table), *([table.note] if table.note else [])]


def _caveat_lines(caveats: Sequence[Caveat]) -> list[str]:
    if not caveats:
        return []
    counts = ", ".join(f"{caveat.name.replace('_', ' ')} {caveat.pairs}" for caveat in caveats)
    return wrap(f"Notes on pairs (see report.md): {counts}.", 100)


def _section_lines(report: Report) -> Iterator[str]:
    for title, measure in main_measures(report):
        yield f"{title:<32}{measure_text(measure)}"


def _header(report: Report) -> list[str]:
    pairs = report.pairs
    title, played = title_text(report), f"{pairs.played} of {pairs.planned} planned pairs played"
    line = f"{title}: {played}"
    return [line] if len(line) <= 100 else [*wrap(f"{title}:", 100), played]


def _written(paths: Sequence[str]) -> list[str]:
    return [f"Written: {', '.join(paths)}"] if paths else []
