"""Pieces of Markdown: tables, and docstrings turned into it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_ROLE = re.compile(r":[a-z]+:`~?\.?(?P<target>[^`]+)`")
_CODE = re.compile(r"``([^`]+)``")


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; line breaks in a cell become spaces."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines)


def prose(text: str) -> str:
    """A docstring as Markdown: roles and double backticks become single ones, ``::`` a colon."""
    text = _ROLE.sub(lambda match: f"`{_short(match['target'])}`", text)
    return re.sub(r"::$", ":", _CODE.sub(r"`\1`", text), flags=re.M)


def one_line(text: str) -> str:
    """The same on one line."""
    return " ".join(prose(text).split())


def code(text: object) -> str:
    """Inline code."""
    return f"`{text}`"


def _short(target: str) -> str:
    """``Class.name`` of a method or attribute, and the last name of anything else."""
    parts = target.strip("!").split(".")
    return ".".join(parts[-2:] if len(parts) > 1 and parts[-2][:1].isupper() else parts[-1:])


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
