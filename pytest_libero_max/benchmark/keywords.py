"""Expressions over parts of names, with the grammar of pytest's ``-k``: ``camera_shift and not v1``."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

from pytest_libero_max.errors import OptionError

_TOKEN = re.compile(r"[()]|[^\s()]+")
_WORDS = ("and", "or", "not", "(", ")")


def matches(expression: str, names: Collection[str]) -> bool:
    """Return True if an expression holds, where a word is true that is a part of a name in any case.

    Raises:
        OptionError: It is no such expression.
    """
    tokens = _Tokens(expression)
    lower = [name.lower() for name in names]
    value = _any_of(tokens, lower)
    if tokens.next is not None:
        raise tokens.unexpected()
    return value


class _Tokens:
    """The words and brackets of an expression, one ahead."""

    def __init__(self, expression: str) -> None:
        self.expression = expression
        self._rest: Iterator[str] = iter(_TOKEN.findall(expression))
        self.next: str | None = next(self._rest, None)

    def accept(self, token: str) -> bool:
        """Return True, and go on, if this is the next token."""
        if self.next != token:
            return False
        self.next = next(self._rest, None)
        return True

    def word(self) -> str:
        """Return the next token, which is a part of a name, and go on."""
        if self.next is None or self.next in _WORDS:
            raise self.unexpected()
        word = self.next
        self.next = next(self._rest, None)
        return word

    def unexpected(self) -> OptionError:
        """Return the error of a token at a place where it has no meaning."""
        place = "its end" if self.next is None else repr(self.next)
        return OptionError.seen(
            "expression",
            self.expression,
            f" has {place} where it means nothing. Write parts of names with and, or, not and brackets.",
        )


def _any_of(tokens: _Tokens, names: Collection[str]) -> bool:
    value = _all_of(tokens, names)
    while tokens.accept("or"):
        value = _all_of(tokens, names) or value  # in this order: the second one has to be read
    return value


def _all_of(tokens: _Tokens, names: Collection[str]) -> bool:
    value = _one_of(tokens, names)
    while tokens.accept("and"):
        value = _one_of(tokens, names) and value
    return value


def _one_of(tokens: _Tokens, names: Collection[str]) -> bool:
    if tokens.accept("not"):
        return not _one_of(tokens, names)
    if tokens.accept("("):
        value = _any_of(tokens, names)
        if not tokens.accept(")"):
            raise tokens.unexpected()
        return value
    word = tokens.word().lower()
    return any(word in name for name in names)
