"""``libero-max list words``: what the words and letters of reports mean."""

from __future__ import annotations

import argparse
import textwrap
import tomllib
from pathlib import Path

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.terminal import say

GLOSSARY = Path(__file__).parents[1] / "glossary.toml"
"""Meanings by word; the words are in alphabetical order."""


def add_command(commands: Commands) -> None:
    """Add ``words`` to the parser."""
    words = commands.add_parser("words", help="What the words and letters of reports mean, all or some")
    words.add_argument("word", nargs="*", metavar="WORD", help="A word, for example H or 'stale action'")
    words.set_defaults(run=_words)


def _words(options: argparse.Namespace) -> int:
    from pytest_libero_max.benchmark.documents import read_text
    from pytest_libero_max.errors import OptionError, did_you_mean

    meanings: dict[str, str] = tomllib.loads(read_text(GLOSSARY))
    for word in options.word or meanings:
        if word not in meanings:
            raise OptionError.seen("word", word, f" is not in the glossary. {did_you_mean(word, meanings)}")
        say(textwrap.wrap(f"{word}: {meanings[word]}", 100, subsequent_indent="  "))
    return 0
