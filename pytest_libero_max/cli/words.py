"""``libero-max list words``: what the words and letters of reports mean."""

from __future__ import annotations

import argparse
import textwrap

from pytest_libero_max.cli.arguments import Commands
from pytest_libero_max.cli.terminal import say


def add_command(commands: Commands) -> None:
    """Add ``words`` to the parser."""
    words = commands.add_parser("words", help="What the words and letters of reports mean, all or some")
    words.add_argument("word", nargs="*", metavar="WORD", help="A word, for example H or 'stale action'")
    words.set_defaults(run=_words)


def _words(options: argparse.Namespace) -> int:
    from pytest_libero_max.errors import OptionError, did_you_mean
    from pytest_libero_max.report.page.words import glossary

    meanings = glossary()
    for word in options.word or meanings:
        if word not in meanings:
            raise OptionError.seen("word", word, f" is not in the glossary. {did_you_mean(word, meanings)}")
        say(textwrap.wrap(f"{word}: {meanings[word]}", 100, subsequent_indent="  "))
    return 0
