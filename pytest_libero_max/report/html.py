"""The report a person reads: one page that needs no network and no script."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from html import escape
from urllib.parse import quote

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report import highlights
from pytest_libero_max.report.caveats import caveat_text
from pytest_libero_max.report.columns import Table, columns_in, headings
from pytest_libero_max.report.dimensions import DIMENSIONS
from pytest_libero_max.report.figures import arrow_plot, category_map, change_profile, stale_histogram
from pytest_libero_max.report.formats import percent, rate_text
from pytest_libero_max.report.highlights import highlight_rows
from pytest_libero_max.report.statements import LIMITS_TITLE
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

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;max-width:62rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem;margin:0 0 .5rem}
h2{font-size:1.1rem;margin:2.2rem 0 .6rem;border-bottom:1px solid #d8dee4}
.note{background:#f2f5f7;border-left:4px solid #66727f;padding:.5rem .8rem;margin:.6rem 0}
.alarm{background:#fbeae4;border-left-color:#b3421b}
.cards{display:flex;gap:1rem;flex-wrap:wrap;margin:1rem 0}
.card{flex:1 1 14rem;border:1px solid #d8dee4;border-radius:6px;padding:.7rem 1rem}
.card b{display:block;font-size:1.9rem;font-weight:600}.card span{color:#66727f}
table{border-collapse:collapse;margin:.4rem 0;font-variant-numeric:tabular-nums}
th,td{padding:.22rem .7rem;border-bottom:1px solid #e6eaee;text-align:left;white-space:nowrap}
td+td,th+th{text-align:right}th{white-space:normal;vertical-align:bottom}.wide{overflow-x:auto}svg{max-width:100%;height:auto;display:block}
details{margin:.5rem 0}summary{cursor:pointer}code{background:#f2f5f7;padding:.1rem .3rem}
.origin td+td,.words td+td,.words th+th{text-align:left;white-space:normal;overflow-wrap:anywhere}
.outcomes td{border:1px solid #d8dee4;text-align:center!important;padding:.5rem 1rem}
"""


def html(
    report: Json, regressions: Sequence[str], replay: Sequence[str], films: Mapping[str, str] | None = None
) -> str:
    """Render a report as a page.

    Args:
        report: What :func:`~pytest_libero_max.report.build.build_report` returned.
        regressions: Item ids of the pairs that succeed in Base and fail in Dynamic.
        replay: The command that plays one of them again, once its item id is appended.
        films: Path of the film of each pair that has one, relative to the page, by item id.
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
        body += _results(report)
        body += _regressions(regressions, replay, films or {})
        others = [item for item in films or {} if item not in regressions]
        body += [_listed(f"Films of {len(others)} other pairs", others, films or {})] if others else []
    body += _study(report["study"]) if "study" in report else []
    body += _faults(pairs)
    for title, values in report["sections"].items():
        body += [f"<h2>{escape(title)}</h2>", _table(("Name", "Value"), list(values.items()))]
    body += [f"<h2>{LIMITS_TITLE}</h2>", "<ul>"]
    body += [f"<li>{escape(text)}</li>" for text in report["statements"].values()]
    body += ["</ul>", *_provenance(report)]
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        f"<title>{escape(title_text(report))}</title><style>{_STYLE}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _results(report: Json) -> list[str]:
    overall = report["overall"]
    body = [
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
        "<h2>From Base to Dynamic</h2>",
        "<p>A ring is Base success, the arrow ends at Dynamic success; pairs in brackets.</p>",
        arrow_plot(report),
    ]
    if any_floor(report["by"]["event"].values()):
        body.append(f"<p>{escape(FLOOR_NOTE)}</p>")
    body += [
        "<h2>Paired change by event</h2>",
        "<p>Percentage points with 95% intervals.</p>",
        change_profile(report),
        "<h2>Source categories</h2>",
        "<p>Paired change in percentage points (pairs). Cells hold different cases and describe them.</p>",
        category_map(report),
        "<h2>Coverage and stale actions</h2>",
        _coverage(report),
        stale_histogram(report),
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
    body += study_figures(study).values()
    for table in study_tables(study):
        body += [f"<h3>{escape(table.title)}</h3>", _table(table.head, table.rows)]
        body += [f"<p>{escape(table.note)}</p>"] if table.note else []
    return body


def _outcomes(outcomes: Json) -> str:
    return (
        "<table class='outcomes'><tr><td></td><td>Dynamic succeeds</td><td>Dynamic fails</td></tr>"
        f"<tr><td>Base succeeds</td><td>{outcomes['preserved_success']}<br>preserved</td>"
        f"<td>{outcomes['regression']}<br>regression</td></tr>"
        f"<tr><td>Base fails</td><td>{outcomes['change_associated_success']}<br>change-associated</td>"
        f"<td>{outcomes['persistent_failure']}<br>persistent failure</td></tr></table>"
    )


def _coverage(report: Json) -> str:
    table = _groups("coverage", "Event", {ALL_PAIRS: report["overall"], **report["by"]["event"]})
    noise, clipping = noise_text(report), clipping_text(report)
    if noise is not None:
        table += f"<p>Noise floor, Base played twice: {escape(noise)}</p>"
    return table if clipping is None else f"{table}<p>{escape(clipping)}</p>"


def _breakdown(report: Json, key: str, title: str) -> str:
    table = _groups("groups", title, report["by"][key])
    return f"<details><summary>{escape(title)}</summary>{table}</details>"


def _groups(table: Table, title: str, groups: Mapping[str, Json]) -> str:
    """One row a group, and the note on groups whose Base success is too low."""
    columns = columns_in(table)
    rows = [
        (group_label(name, row), *(column.long(row) for column in columns)) for name, row in groups.items()
    ]
    note = f"<p>{escape(FLOOR_NOTE)}</p>" if any_floor(groups.values()) else ""
    return _table((title, *headings(table)), rows) + note


def _regressions(regressions: Sequence[str], replay: Sequence[str], films: Mapping[str, str]) -> list[str]:
    if not regressions:
        return []
    return [
        "<h2>Regressions</h2>",
        f"<p>Play one again: <code>{escape(shlex.join(replay))} NAME</code>. Its record is a line of "
        "<a href='pairs.jsonl'>pairs.jsonl</a>.</p>",
        _listed(f"{len(regressions)} pairs succeed in Base and fail in Dynamic", regressions, films),
    ]


def _listed(title: str, items: Sequence[str], films: Mapping[str, str]) -> str:
    listed = "".join(f"<li>{_pair(item, films)}</li>" for item in items)
    return f"<details><summary>{escape(title)}</summary><ul>{listed}</ul></details>"


def _pair(item: str, films: Mapping[str, str]) -> str:
    """The name of a pair, with a link to its film where there is one."""
    film = f" <a href='{quote(films[item])}'>film</a>" if item in films else ""
    return f"<code>{escape(item)}</code>{film}"


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


def _provenance(report: Json) -> list[str]:
    origin = report["provenance"]
    rows = [(name, version or "not installed") for name, version in origin["versions"].items()]
    rows += [("case set", f"{origin['case_set']['name']}, {origin['case_set']['digest'][:12]}")]
    if "released_as" in origin["case_set"]:
        rows.append(("case set is", origin["case_set"]["released_as"]))
    if report["selection"]:
        rows += [("selection", f"{selection_text(report)}, {report['selection']['digest'][:12]}")]
    rows += [("MUJOCO_GL", origin["gl_backend"] or "not set"), ("command", shlex.join(origin["command"]))]
    return ["<h2>Provenance</h2>", "<div class='origin'>", _table(("", ""), rows), "</div>"]


def _card(name: str, rate: Json) -> str:
    value = percent(rate["value"])
    detail = rate_text(rate).removeprefix(value).strip()
    return f"<div class='card'>{escape(name)}<b>{value}</b><span>{escape(detail)}</span></div>"


def _note(words: str, kind: str = "") -> str:
    return f"<p class='note {kind}'>{escape(words)}</p>"


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<div class='wide'><table><tr>{top}</tr>{body}</table></div>"
