"""Words of a page that the glossary explains."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

from markupsafe import Markup, escape

from pytest_libero_max.benchmark.documents import read_text

GLOSSARY = Path(__file__).parents[2] / "glossary.toml"
"""File of the meanings by word; the words are in alphabetical order."""

_ON_PAGES = (
    "Base", "Dynamic", "pair", "case", "event", "Base success", "Dynamic success", "paired change",
    "percentage point", "confidence interval", "regression", "gain", "preserved success",
    "persistent failure", "lost", "retained", "event fired", "query", "query after the event",
    "stale action", "cause", "category", "suite", "track", "substrate", "embedded", "privileged",
    "effective tasks", "McNemar", "gate", "H", "Q",
)  # fmt: skip


_NOT_PLAIN = ("substrate", "stale actions", "stale action")
"""Words that the first screen explains where they stand; each is a word of the glossary, or its plural."""


def explained(text: str) -> Markup:
    """Return a text in which words that are not plain English have their meanings."""
    pattern = re.compile("|".join(_NOT_PLAIN))
    parts, end = [], 0
    for match in pattern.finditer(text):
        meaning = words()[match[0].removesuffix("s")]
        parts += [
            escape(text[end : match.start()]),
            Markup("<abbr title='{}'>{}</abbr>").format(meaning, match[0]),
        ]
        end = match.end()
    return Markup("").join([*parts, escape(text[end:])])


@cache
def words() -> dict[str, str]:
    """Return the words of pages in the order in which they are met, with their meanings."""
    return {word: glossary()[word] for word in _ON_PAGES}


@cache
def glossary() -> dict[str, str]:
    """Return the meanings of all words, in alphabetical order."""
    return tomllib.loads(read_text(GLOSSARY))
