"""The grammar of -k, compared with pytest's own."""

from __future__ import annotations

import pytest
from _pytest.mark.expression import Expression
from hypothesis import given
from hypothesis import strategies as st

from pytest_libero_max.benchmark.keywords import matches
from pytest_libero_max.errors import OptionError

NAMES = ("libero-object-t09-i06-camera_shift-v1", "geometry", "variant_1")
WORDS = st.sampled_from(["camera_shift", "v1", "V0", "t09-i06", "geometry", "libero-goal"])
EXPRESSIONS = st.recursive(
    WORDS,
    lambda inner: st.one_of(
        inner.map("not {}".format),
        inner.map("({})".format),
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(" ".join),
    ),
    max_leaves=8,
)


@given(EXPRESSIONS)
def test_an_expression_selects_what_it_selects_for_pytest(expression: str) -> None:
    def contains(word: str, /, **arguments: str | int | bool | None) -> bool:
        return any(word.lower() in name.lower() for name in NAMES)

    assert matches(expression, NAMES) == Expression.compile(expression).evaluate(contains)


@pytest.mark.parametrize("expression", ["", "and", "a and", "a b", "(a", "a)", "not", "a or or b"])
def test_what_is_no_expression_is_refused(expression: str) -> None:
    with pytest.raises(OptionError, match="where it means nothing"):
        matches(expression, NAMES)
