"""Pieces of markup that pages share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple


class Viewed(NamedTuple):
    """A name that leads to a view of the table of cases.

    Attributes:
        name: Plain text.
        view: Text behind ``#cases?`` in the address of the view; empty where the name leads nowhere.
    """

    name: str
    view: str


def note(words: str, kind: str = "") -> str:
    """Return a paragraph that stands out; of kind ``alarm``, more so."""
    return f"<p class='note {kind}'>{escape(words)}</p>"


def figure(svg: str, caption: str = "") -> str:
    """Return a figure in a frame that scrolls where the window is narrower."""
    words = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure><div class='wide'>{svg}</div>{words}</figure>"


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table whose first column names the rows."""
    top = "".join(f"<th scope='col'>{escape(cell)}</th>" for cell in head)
    body = "".join(
        f"<tr><th scope='row'>{_name(name)}</th>"
        + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
        + "</tr>"
        for name, *cells in rows
    )
    heading = f"<thead><tr>{top}</tr></thead>" if head else ""
    return f"<div class='wide'><table>{heading}<tbody>{body}</tbody></table></div>"


def listed(texts: Iterable[str]) -> str:
    """Plain texts as a list."""
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"


def _name(name: object) -> str:
    if isinstance(name, Viewed) and name.view:
        return f"<span data-view='{escape(name.view)}'>{escape(name.name)}</span>"
    return escape(name.name if isinstance(name, Viewed) else str(name))
