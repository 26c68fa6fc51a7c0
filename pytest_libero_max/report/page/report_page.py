"""The page of a run: one file that needs no network. Without scripts it lacks the table of cases."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from html import escape
from urllib.parse import quote, urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report import highlights
from pytest_libero_max.report.blocks import Outcomes, Rate, Result
from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.columns import Table, columns_in, headings
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.formats import percent, rate_text
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.measurable import warning_of
from pytest_libero_max.report.page.case_table import CASES_SECTION, OUTCOME_TITLES
from pytest_libero_max.report.page.events import events_section
from pytest_libero_max.report.page.markup import Viewed, figure, listed, note, table
from pytest_libero_max.report.page.origin import origin_rows
from pytest_libero_max.report.page.page_frame import document
from pytest_libero_max.report.report_document import PairCounts, Report
from pytest_libero_max.report.sham import SHAM_TITLE, sham_text
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.studies.study_document import Study
from pytest_libero_max.report.studies.study_figures import study_figures
from pytest_libero_max.report.studies.study_tables import study_notes, study_tables
from pytest_libero_max.report.writers.figures import arrow_plot, category_map, change_profile, stale_histogram
from pytest_libero_max.report.writers.summary import (
    ALL_PAIRS,
    FLOOR_NOTE,
    GIVEN_RESPONSE_NOTE,
    any_floor,
    clipping_text,
    group_label,
    incomplete_text,
    noise_text,
    repaired_text,
    selection_text,
    title_text,
    unsupported_text,
)
from pytest_libero_max.runs.store import PAIRS_NAME, StoredRun


def html(
    report: Report,
    regressions: Sequence[str],
    replay: Sequence[str],
    films: Mapping[str, Sequence[str]] | None = None,
    stored: StoredRun | None = None,
    cases: Json | None = None,
    pairs_name: str = PAIRS_NAME,
) -> str:
    """Render a report as a page.

    Args:
        report: Result of :func:`~pytest_libero_max.report.build.build_report`.
        regressions: Item ids of the pairs that succeed in Base and fail in Dynamic.
        replay: The command that plays one of them again, once its item id is appended.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        stored: The run, for its events and its origin; None leaves these out.
        cases: Result of :func:`~pytest_libero_max.report.page.case_table.run_cases`;
            None leaves it out.
        pairs_name: The file of the pairs beside the page.
    """
    pairs = report.pairs
    body = [f"<h1>{escape(title_text(report))}</h1>"]
    body.append(f"<p>{pairs.played} of {pairs.planned} planned pairs played</p>")
    body += [_ways(pairs.played > 0)] if cases is not None else []
    if not pairs.complete:
        body.append(note(f"{incomplete_text(pairs)} All rates are over the played pairs.", "alarm"))
    partial = unsupported_text(pairs)
    if partial is not None:
        body.append(note(partial, "alarm"))
    repaired = repaired_text(pairs)
    if repaired is not None:
        body.append(note(repaired))
    if report.substrate.note:
        body.append(note(report.substrate.note))
    warning = warning_of(report.overall)
    if warning is not None:
        body.append(note(warning, "alarm"))
    body += [note(caveat_text(caveat)) for caveat in report.caveats]
    if pairs.played:
        body += _summary(report)
    if cases is not None:
        body.append(CASES_SECTION)
    if stored is not None:
        body += events_section(stored.run.planned, stored.records)
    if pairs.played:
        body += _results(report)
        body += _regressions(regressions, replay, films or {}, pairs_name)
        others = [item for item in films or {} if item not in regressions]
        body += [_listed(f"Films of {len(others)} other pairs", others, films or {})] if others else []
    body += [] if report.study is None else _study(report.study)
    body += _faults(pairs)
    for title, values in report.sections.items():
        body += [f"<h2>{escape(title)}</h2>", table(("Name", "Value"), list(values.items()))]
    body += [f"<h2>{LIMITS_TITLE}</h2>", listed(report.statements.values())]
    body += _provenance(report, stored)
    return document(title_text(report), body, cases)


def _ways(played: bool) -> str:
    """Links to the parts of the page."""
    titles = ("Events", "Figures", "Breakdowns", "Provenance") if played else ("Events", "Provenance")
    links = "".join(f"<a href='#{title.lower()}'>{title}</a> " for title in titles)
    return f"<nav aria-label='Parts of this page'><a href='#cases' data-with-script>Cases</a> {links}</nav>"


def _summary(report: Report) -> list[str]:
    overall = report.overall
    return [
        "<div class='cards'>",
        _card("Base success", overall.base_success),
        _card("Dynamic success", overall.dynamic_success),
        _card("Base successes lost", overall.conditional_regression),
        "</div>",
        table(
            ("Quantity", "Value"), [(column.title, column.long(overall)) for column in columns_in("summary")]
        ),
        "<h2>Outcomes</h2>",
        _outcomes(overall.outcomes),
    ]


def _results(report: Report) -> list[str]:
    overall = report.overall
    body = [
        "<h2 id='figures'>From Base to Dynamic</h2>",
        "<p>A ring is Base success, the arrow ends at Dynamic success; pairs in brackets.</p>",
        figure(arrow_plot(report)),
    ]
    if any_floor(report.by["event"].values()):
        body.append(f"<p>{escape(FLOOR_NOTE)}</p>")
    body += [
        "<h2>Paired change by event</h2>",
        "<p>Percentage points with 95% intervals.</p>",
        figure(change_profile(report)),
        "<h2>Source categories</h2>",
        "<p>Paired change in percentage points (pairs). Cells hold different cases and describe them.</p>",
        figure(category_map(report)),
        "<h2>Coverage and stale actions</h2>",
        _coverage(report),
        figure(stale_histogram(report)),
        "<h2>Given a query after the event</h2>",
        f"<p>{escape(GIVEN_RESPONSE_NOTE)}</p>",
        _groups("given_response", "Event", {ALL_PAIRS: overall, **report.by["event"]}),
        f"<h2>{highlights.TITLE}</h2>",
        f"<p>{escape(highlights.NOTE)}</p>",
        f"<div class='words'>{table(('What', 'Where', 'Value'), highlight_rows(report))}</div>",
        "<h2 id='breakdowns'>Breakdowns</h2>",
    ]
    return body + [_breakdown(report, key, dimension.title) for key, dimension in DIMENSIONS.items()]


def _study(study: Study) -> list[str]:
    body = [f"<h2>Study: {escape(study.title)}</h2>"]
    body += [f"<p>{escape(note)}</p>" for note in study_notes(study)]
    body += map(figure, study_figures(study).values())
    for part in study_tables(study):
        body += [f"<h3>{escape(part.title)}</h3>", table(part.head, part.rows)]
        body += [f"<p>{escape(part.note)}</p>"] if part.note else []
    return body


def _outcomes(outcomes: Outcomes) -> str:
    def cell(outcome: str) -> str:
        view = f"outcome={outcome}"
        return (
            f"<td><span data-view='{view}'>{getattr(outcomes, outcome)} {OUTCOME_TITLES[outcome]}</span></td>"
        )

    return (
        "<div class='wide'><table class='outcomes'><thead><tr><td></td>"
        "<th scope='col'>Dynamic succeeds</th><th scope='col'>Dynamic fails</th></tr></thead><tbody>"
        f"<tr><th scope='row'>Base succeeds</th>{cell('preserved_success')}{cell('regression')}</tr>"
        "<tr><th scope='row'>Base fails</th>"
        f"{cell('change_associated_success')}{cell('persistent_failure')}</tr></tbody></table></div>"
    )


def _coverage(report: Report) -> str:
    groups = _groups("coverage", "Event", {ALL_PAIRS: report.overall, **report.by["event"]})
    noise, clipping = noise_text(report), clipping_text(report)
    if noise is not None:
        groups += f"<p>Noise floor, Base played twice: {escape(noise)}</p>"
    sham = sham_text(report)
    if sham is not None:
        groups += f"<p>{SHAM_TITLE}: {escape(sham)}</p>"
    return groups if clipping is None else f"{groups}<p>{escape(clipping)}</p>"


def _breakdown(report: Report, key: str, title: str) -> str:
    groups = _groups("groups", title, report.by[key], key)
    return f"<details><summary>{escape(title)}</summary>{groups}</details>"


def _groups(kind: Table, title: str, groups: Mapping[str, Result], dimension: str = "event") -> str:
    """One row a group, and the note on groups whose Base success is too low."""
    columns = columns_in(kind)
    rows = [
        (Viewed(group_label(name, row), _view(dimension, name)), *(column.long(row) for column in columns))
        for name, row in groups.items()
    ]
    floor = f"<p>{escape(FLOOR_NOTE)}</p>" if any_floor(groups.values()) else ""
    return table((title, *headings(kind)), rows) + floor


def _view(dimension: str, name: str) -> str:
    if name == ALL_PAIRS:
        return ""
    if dimension == "variant":
        event, _, variant = name.rpartition("-v")
        return urlencode({"event": event, "variant": variant})
    return urlencode({dimension: name})


def _regressions(
    regressions: Sequence[str], replay: Sequence[str], films: Mapping[str, Sequence[str]], pairs_name: str
) -> list[str]:
    if not regressions:
        return []
    return [
        "<h2>Regressions</h2>",
        f"<p>Play one again: <code>{escape(shlex.join(replay))} NAME</code>. Its record is a line of "
        f"<a href='{pairs_name}'>{pairs_name}</a>.</p>",
        _listed(f"{len(regressions)} pairs succeed in Base and fail in Dynamic", regressions, films),
    ]


def _listed(title: str, items: Sequence[str], films: Mapping[str, Sequence[str]]) -> str:
    """Names of pairs; the table of cases replaces the list."""
    pairs = "".join(f"<li>{_pair(item, films)}</li>" for item in items)
    return f"<details data-without-script><summary>{escape(title)}</summary><ul>{pairs}</ul></details>"


def _pair(item: str, films: Mapping[str, Sequence[str]]) -> str:
    """Return the name of a pair, with links to its films."""
    links = "".join(f" <a href='{quote(film)}'>film</a>" for film in films.get(item, ()))
    return f"<code>{escape(item)}</code>{links}"


def _faults(pairs: PairCounts) -> list[str]:
    body = []
    if pairs.invalid_pairs:
        rows = [(pair.item_id, pair.phase, pair.kind, pair.message) for pair in pairs.invalid_pairs]
        found = table(("Pair", "Phase", "Error", "Message"), rows)
        body += ["<h2>Invalid pairs</h2>", f"<div class='words'>{found}</div>"]
    if pairs.missing_pairs:
        items = "".join(f"<li><code>{escape(pair.item_id)}</code></li>" for pair in pairs.missing_pairs)
        body += [f"<div data-without-script><h2>Missing pairs</h2><ul>{items}</ul></div>"]
    return body


def _provenance(report: Report, stored: StoredRun | None) -> list[str]:
    origin = report.provenance
    rows = list(origin_rows(report, stored)) if stored is not None else []
    rows += [(name, version or "not installed") for name, version in origin["versions"].items()]
    rows += [("case set", f"{origin['case_set']['name']}, {origin['case_set']['digest'][:12]}")]
    if "released_as" in origin["case_set"]:
        rows.append(("case set is", origin["case_set"]["released_as"]))
    if report.selection:
        rows += [("selection", f"{selection_text(report)}, {report.selection.digest[:12]}")]
    rows += [("MUJOCO_GL", origin.get("gl_backend") or "not set"), ("command", shlex.join(origin["command"]))]
    return ["<h2 id='provenance'>Provenance</h2>", "<div class='words'>", table((), rows), "</div>"]


def _card(name: str, rate: Rate) -> str:
    value = percent(rate.value)
    detail = rate_text(rate).removeprefix(value).strip()
    return f"<div class='card'>{escape(name)}<b>{value}</b><span>{escape(detail)}</span></div>"
