"""Pages made from templates, which escape the text put into them; style, script and data are inside."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Collection, Sequence
from functools import cache
from importlib import resources
from typing import Any, NamedTuple
from urllib.parse import urlencode

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.report import palette
from pytest_libero_max.report.document import Document, Link, Table
from pytest_libero_max.report.groups import ALL_PAIRS, FLOOR_MARK
from pytest_libero_max.report.page.words import explained
from pytest_libero_max.report.quantities import Cell
from pytest_libero_max.report.statements import CAVEATS_TITLE, LIMITS_TITLE

_SCRIPTS = ("table.js", "player.js", "detail.js", "explorer.js")

_NARROW = 5
"""Most columns of a table that has half of a wide window."""

DETAILS_IN_A_PART = 100
"""Number of cases whose details are packed together. A page unpacks a part when a case of it is opened."""


class PageCell(NamedTuple):
    """A cell of a table as templates print it."""

    text: str
    order: float | str
    view: str = ""
    """View of the table of cases that it leads to; empty for none."""
    address: str = ""
    """File that it leads to; empty for none."""


class PageTable(NamedTuple):
    """A table as templates print it."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[PageCell]]
    note: str
    kinds: str


def page_table(table: Table) -> PageTable:
    """Return a table whose rows lead to their cases, where they are of the groups of a dimension."""
    rows = [[_page_cell(cell) for cell in row] for row in table.cells()]
    if table.dimension:
        rows = [[name._replace(view=_view(table.dimension, name.text)), *cells] for name, *cells in rows]
    words = all(isinstance(cell.value, str) for row in table.cells() for cell in row[1:])
    wide = len(table.head) > _NARROW
    known = {"wide": wide, "words": words or table.sortable, "sorted": table.sortable}
    kinds = ["rows", *(kind for kind, is_so in known.items() if is_so)]
    return PageTable(table.title, table.headings(), rows, table.note, " ".join(kinds))


def _page_cell(cell: Cell) -> PageCell:
    text, number = cell.format.long(cell.value), cell.format.numbers(cell.value).get("")
    address = cell.value.address if isinstance(cell.value, Link) else ""
    return PageCell(text, "" if number is None else number, address=address)


def _view(dimension: str, name: str) -> str:
    name = name.removesuffix(FLOOR_MARK)
    if name == ALL_PAIRS:
        return ""
    if dimension == "variant":
        event, _, variant = name.rpartition("-v")
        return urlencode({"event": event, "variant": variant})
    return urlencode({dimension: name})


def document_page(
    template: str, document: Document, cases: Json | None = None, own_way: Collection[str] = (), **values: Any
) -> str:
    """Render a document with a template that extends ``document.html``; see :func:`page`."""
    return page(
        template,
        document.title,
        cases,
        document=document,
        sections=[
            (section, [*map(page_table, section.tables)])
            for section in document.sections
            if section.key not in own_way
        ],
        caveats_title=CAVEATS_TITLE,
        limits_title=LIMITS_TITLE,
        **values,
    )


def page(template: str, title: str, cases: Json | None, scripts: Sequence[str] = (), **values: Any) -> str:
    """Render a page that needs no network.

    Args:
        cases: Data of the table of cases, see :mod:`~pytest_libero_max.report.page.case_table`; None for a
            page without it.
    """
    if cases is not None:
        scripts = _SCRIPTS
    script = _script(tuple(scripts))
    return (
        _environment()
        .get_template(template)
        .render(
            title=title,
            cases=None
            if cases is None
            else compressed({**cases, "details": None, "part": DETAILS_IN_A_PART}),
            details=[] if cases is None else [*map(compressed, _parts(cases["details"]))],
            security_policy=_security_policy(script),
            style=Markup(palette.css() + _file("style.css")),
            script=script,
            **values,
        )
    )


def compressed(values: Any) -> str:
    """Return JSON as gzip in base64, which ``explorer.js`` reads."""
    text = json.dumps(values, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _parts(details: list[Any]) -> list[list[Any]]:
    return [details[begin : begin + DETAILS_IN_A_PART] for begin in range(0, len(details), DETAILS_IN_A_PART)]


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        loader=FunctionLoader(lambda name: _file(f"templates/{name}")),
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters["explained"] = explained
    return environment


@cache
def _script(files: tuple[str, ...]) -> Markup:
    """Return files as one function, so that no name of theirs is a name of the page; empty for none."""
    return Markup('"use strict";(() => {\n' + "\n".join(map(_file, files)) + "})();" if files else "")


def _security_policy(own: Markup) -> Markup:
    """Return the content security policy: a page may show files beside it and run its own script alone."""
    digest = base64.b64encode(hashlib.sha256(own.encode()).digest()).decode()
    script = f"'sha256-{digest}'" if own else "'none'"
    return Markup(
        f"default-src 'none'; script-src {script}; style-src 'unsafe-inline'; "
        "img-src 'self' file: data:; media-src 'self' file:; base-uri 'none'; form-action 'none'"
    )


@cache
def _file(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
