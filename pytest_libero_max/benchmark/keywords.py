"""Expressions over parts of names, with the grammar of pytest's ``-k``: ``camera_shift and not v1``."""

from __future__ import annotations

from collections.abc import Collection

from pytest_libero_max.errors import OptionError


def matches(expression: str, names: Collection[str]) -> bool:
    """Return True if an expression holds, where a word is true that is a part of a name in any case.

    Raises:
        OptionError: It is no such expression.
    """
    from _pytest.mark.expression import Expression  # the grammar itself, which pytest exports nowhere

    lower = [name.lower() for name in names]
    try:
        compiled = Expression.compile(expression)
    except Exception as error:  # until pytest 8.4 a class of its own, then SyntaxError
        raise OptionError.seen(
            "expression", expression, f": {error}. Write parts of names with and, or, not and brackets."
        ) from None

    def holds(word: str, /, **_: str | int | bool | None) -> bool:
        return any(word.lower() in name for name in lower)

    return compiled.evaluate(holds)
