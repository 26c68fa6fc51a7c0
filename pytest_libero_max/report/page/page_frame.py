"""The frame of a page, with its style, script and data inside, so that it is one file."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib import resources

from pytest_libero_max.benchmark.documents import Json

_SCRIPTS = ("table.js", "detail.js", "explorer.js")
_HERE = "pytest_libero_max.report.page"


def document(title: str, body: Sequence[str], cases: Json | None = None) -> str:
    """Return a whole page.

    Args:
        title: Plain text.
        body: Markup.
        cases: Data of the table of cases, see :mod:`~pytest_libero_max.report.page.case_table`; None for a
            page without it, which has no script.
    """
    head = [
        "<meta charset='utf-8'>",
        "<meta name='viewport' content='width=device-width,initial-scale=1'>",
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(cases is not None)}">',
        f"<title>{escape(title)}</title><style>{_file('style.css')}</style>",
    ]
    end = "" if cases is None else f"{_data(cases)}<script>{_script()}</script>\n"
    return (
        "<!doctype html>\n<html lang='en'><head>"
        + "".join(head)
        + "</head>\n<body>\n"
        + "\n".join(body)
        + f"\n{end}</body></html>\n"
    )


def embedded_json(values: Json) -> str:
    """Return compact JSON in which nothing can end the ``<script>`` element around it."""
    text = json.dumps(values, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _data(cases: Json) -> str:
    return f"<script type='application/json' id='cases-data'>{embedded_json(cases)}</script>\n"


@cache
def _script() -> str:
    """Return the files as one function, so that no name of theirs is a name of the page."""
    return '"use strict";(() => {\n' + "\n".join(map(_file, _SCRIPTS)) + "})();"


def _policy(scripted: bool) -> str:
    """Return the content security policy: a page may show files beside it and run its own script alone."""
    digest = base64.b64encode(hashlib.sha256(_script().encode()).digest()).decode()
    script = f"'sha256-{digest}'" if scripted else "'none'"
    return (
        f"default-src 'none'; script-src {script}; style-src 'unsafe-inline'; "
        "img-src 'self' file: data:; media-src 'self' file:; base-uri 'none'; form-action 'none'"
    )


@cache
def _file(name: str) -> str:
    return resources.files(_HERE).joinpath(name).read_text(encoding="utf-8")
