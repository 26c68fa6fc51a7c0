"""The report a person reads: one page that needs no network. What a script adds is the table of cases."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple
from urllib.parse import quote, urlencode

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report import highlights
from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.columns import Table, columns_in, headings
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.figures import arrow_plot, category_map, change_profile, stale_histogram
from pytest_libero_max.report.formats import percent, rate_text
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.page.case_table import CASES_SECTION, OUTCOME_TITLES, run_cases
from pytest_libero_max.report.page.document import document
from pytest_libero_max.report.page.events import events_section
from pytest_libero_max.report.page.origin import origin_rows
from pytest_libero_max.report.statements import LIMITS_TITLE
from pytest_libero_max.report.store import PAIRS_NAME, StoredRun
from pytest_libero_max.report.study_figures import study_figures
from pytest_libero_max.report.study_tables import study_notes, study_tables
from pytest_libero_max.report.summary import (
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


def html(
    report: Json,
    regressions: Sequence[str],
    replay: Sequence[str],
    films: Mapping[str, Sequence[str]] | None = None,
    stored: StoredRun | None = None,
    pictures: Mapping[str, Sequence[str]] | None = None,
    pairs_name: str = PAIRS_NAME,
) -> str:
    """Render a report as a page.

    Args:
        report: What :func:`~pytest_libero_max.report.build.build_report` returned.
        regressions: Item ids of the pairs that succeed in Base and fail in Dynamic.
        replay: The command that plays one of them again, once its item id is appended.
        films: Paths of the films of each pair that has some, relative to the page, by item id.
        stored: The run, for the table of its cases; None leaves the table out.
        pictures: Paths of the pictures of each pair that has some, in the same way.
        pairs_name: The file of the pairs beside the page.
    """
    pairs = report["pairs"]
    body = [f"<h1>{escape(title_text(report))}</h1>"]
    body.append(f"<p>{pairs['played']} of {pairs['planned']} planned pairs played</p>")
    if not pairs["complete"]:
        body.append(_note(f"{incomplete_text(pairs)} All rates are over the played pairs.", "alarm"))
    partial = unsupported_text(pairs)
    if partial is not None:
        body.append(_note(partial, "alarm"))
    repaired = repaired_text(pairs)
    if repaired is not None:
        body.append(_note(repaired))
    if report["substrate"]["note"]:
        body.append(_note(report["substrate"]["note"]))
    body += [_note(caveat_text(caveat)) for caveat in report["caveats"]]
    if pairs["played"]:
        body += _summary(report)
    if stored is not None:
        body.append(CASES_SECTION)
        body += events_section(stored.records, list(report["by"]["variant"]))
    if pairs["played"]:
        body += _results(report)
        body += _regressions(regressions, replay, films or {}, pairs_name)
        others = [item for item in films or {} if item not in regressions]
        body += [_listed(f"Films of {len(others)} other pairs", others, films or {})] if others else []
    body += _study(report["study"]) if "study" in report else []
    body += _faults(pairs)
    for title, values in report["sections"].items():
        body += [f"<h2>{escape(title)}</h2>", _table(("Name", "Value"), list(values.items()))]
    body += [f"<h2>{LIMITS_TITLE}</h2>", "<ul>"]
    body += [f"<li>{escape(text)}</li>" for text in report["statements"].values()]
    body += ["</ul>", *_provenance(report, stored)]
    cases = None if stored is None else run_cases(stored, films or {}, pictures or {})
    return document(title_text(report), body, cases)


def _summary(report: Json) -> list[str]:
    overall = report["overall"]
    return [
        "<div class='cards'>",
        _card("Base success", overall["base_success"]),
        _card("Dynamic success", overall["dynamic_success"]),
        _card("Base successes lost", overall["conditional_regression"]),
        "</div>",
        _table(
            ("Quantity", "Value"), [(column.title, column.long(overall)) for column in columns_in("summary")]
        ),
        "<h2>Outcomes</h2>",
        _outcomes(overall["outcomes"]),
    ]


def _results(report: Json) -> list[str]:
    overall = report["overall"]
    body = [
        "<h2>From Base to Dynamic</h2>",
        "<p>A ring is Base success, the arrow ends at Dynamic success; pairs in brackets.</p>",
        _figure(arrow_plot(report)),
    ]
    if any_floor(report["by"]["event"].values()):
        body.append(f"<p>{escape(FLOOR_NOTE)}</p>")
    body += [
        "<h2>Paired change by event</h2>",
        "<p>Percentage points with 95% intervals.</p>",
        _figure(change_profile(report)),
        "<h2>Source categories</h2>",
        "<p>Paired change in percentage points (pairs). Cells hold different cases and describe them.</p>",
        _figure(category_map(report)),
        "<h2>Coverage and stale actions</h2>",
        _coverage(report),
        _figure(stale_histogram(report)),
        "<h2>Given a query after the event</h2>",
        f"<p>{escape(GIVEN_RESPONSE_NOTE)}</p>",
        _groups("given_response", "Event", {ALL_PAIRS: overall, **report["by"]["event"]}),
        f"<h2>{highlights.TITLE}</h2>",
        f"<p>{escape(highlights.NOTE)}</p>",
        f"<div class='words'>{_table(('What', 'Where', 'Value'), highlight_rows(report))}</div>",
        "<h2>Breakdowns</h2>",
    ]
    return body + [_breakdown(report, key, dimension.title) for key, dimension in DIMENSIONS.items()]


def _study(study: Json) -> list[str]:
    body = [f"<h2>Study: {escape(study['title'])}</h2>"]
    body += [f"<p>{escape(note)}</p>" for note in study_notes(study)]
    body += map(_figure, study_figures(study).values())
    for table in study_tables(study):
        body += [f"<h3>{escape(table.title)}</h3>", _table(table.head, table.rows)]
        body += [f"<p>{escape(table.note)}</p>"] if table.note else []
    return body


def _outcomes(outcomes: Json) -> str:
    def cell(outcome: str) -> str:
        view = f"outcome={outcome}"
        return f"<td><span data-view='{view}'>{outcomes[outcome]} {OUTCOME_TITLES[outcome]}</span></td>"

    return (
        "<div class='wide'><table class='outcomes'><thead><tr><td></td>"
        "<th scope='col'>Dynamic succeeds</th><th scope='col'>Dynamic fails</th></tr></thead><tbody>"
        f"<tr><th scope='row'>Base succeeds</th>{cell('preserved_success')}{cell('regression')}</tr>"
        "<tr><th scope='row'>Base fails</th>"
        f"{cell('change_associated_success')}{cell('persistent_failure')}</tr></tbody></table></div>"
    )


def _coverage(report: Json) -> str:
    table = _groups("coverage", "Event", {ALL_PAIRS: report["overall"], **report["by"]["event"]})
    noise, clipping = noise_text(report), clipping_text(report)
    if noise is not None:
        table += f"<p>Noise floor, Base played twice: {escape(noise)}</p>"
    return table if clipping is None else f"{table}<p>{escape(clipping)}</p>"


def _breakdown(report: Json, key: str, title: str) -> str:
    table = _groups("groups", title, report["by"][key], key)
    return f"<details><summary>{escape(title)}</summary>{table}</details>"


def _groups(table: Table, title: str, groups: Mapping[str, Json], dimension: str = "event") -> str:
    """One row a group, and the note on groups whose Base success is too low."""
    columns = columns_in(table)
    rows = [
        (_Group(group_label(name, row), _view(dimension, name)), *(column.long(row) for column in columns))
        for name, row in groups.items()
    ]
    note = f"<p>{escape(FLOOR_NOTE)}</p>" if any_floor(groups.values()) else ""
    return _table((title, *headings(table)), rows) + note


class _Group(NamedTuple):
    """The name of a group, and the fragment of the table of its cases."""

    name: str
    view: str


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
    listed = "".join(f"<li>{_pair(item, films)}</li>" for item in items)
    return f"<details data-without-script><summary>{escape(title)}</summary><ul>{listed}</ul></details>"


def _pair(item: str, films: Mapping[str, Sequence[str]]) -> str:
    """The name of a pair, with links to its films."""
    links = "".join(f" <a href='{quote(film)}'>film</a>" for film in films.get(item, ()))
    return f"<code>{escape(item)}</code>{links}"


def _faults(pairs: Json) -> list[str]:
    body = []
    if pairs["invalid_pairs"]:
        rows = [
            (pair["item_id"], pair["phase"], pair["kind"], pair["message"]) for pair in pairs["invalid_pairs"]
        ]
        body += ["<h2>Invalid pairs</h2>", _table(("Pair", "Phase", "Error", "Message"), rows)]
    if pairs["missing_pairs"]:
        items = "".join(f"<li><code>{escape(pair['item_id'])}</code></li>" for pair in pairs["missing_pairs"])
        body += [f"<h2>Missing pairs</h2><ul>{items}</ul>"]
    return body


def _provenance(report: Json, stored: StoredRun | None) -> list[str]:
    origin = report["provenance"]
    rows = list(origin_rows(report, stored)) if stored is not None else []
    rows += [(name, version or "not installed") for name, version in origin["versions"].items()]
    rows += [("case set", f"{origin['case_set']['name']}, {origin['case_set']['digest'][:12]}")]
    if "released_as" in origin["case_set"]:
        rows.append(("case set is", origin["case_set"]["released_as"]))
    if report["selection"]:
        rows += [("selection", f"{selection_text(report)}, {report['selection']['digest'][:12]}")]
    rows += [("MUJOCO_GL", origin["gl_backend"] or "not set"), ("command", shlex.join(origin["command"]))]
    return ["<h2 id='provenance'>Provenance</h2>", "<div class='words'>", _table((), rows), "</div>"]


def _card(name: str, rate: Json) -> str:
    value = percent(rate["value"])
    detail = rate_text(rate).removeprefix(value).strip()
    return f"<div class='card'>{escape(name)}<b>{value}</b><span>{escape(detail)}</span></div>"


def _note(words: str, kind: str = "") -> str:
    return f"<p class='note {kind}'>{escape(words)}</p>"


def _figure(svg: str) -> str:
    return f"<figure class='wide'>{svg}</figure>"


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table whose first column names the rows."""
    top = "".join(f"<th scope='col'>{escape(cell)}</th>" for cell in head)
    body = "".join(
        f"<tr><th scope='row'>{_name(name)}</th>"
        + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    heading = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f"<div class='wide'><table>{heading}<tbody>{body}</tbody></table></div>"


def _name(name: object) -> str:
    if isinstance(name, _Group) and name.view:
        return f"<span data-view='{escape(name.view)}'>{escape(name.name)}</span>"
    return escape(name.name if isinstance(name, _Group) else str(name))
