from __future__ import annotations

import pytest

from pytest_libero_max.benchmark.keywords import matches
from pytest_libero_max.errors import OptionError

NAMES = ("libero-object-t09-i06-camera_shift-v1", "geometry", "variant_1")


@pytest.mark.parametrize(
    ("expression", "holds"),
    [
        ("V1", True),
        ("camera_shift and not v1", False),
        ("v0 or (t09-i06 and geometry)", True),
        ("not v1", False),
    ],
)
def test_an_expression_selects_what_it_selects_for_pytest(expression: str, holds: bool) -> None:
    assert matches(expression, NAMES) == holds


@pytest.mark.parametrize("expression", ["and", "a and", "a b", "(a", "a)", "not", "a or or b"])
def test_what_is_no_expression_is_refused(expression: str) -> None:
    with pytest.raises(OptionError) as refused:
        matches(expression, NAMES)
    assert (refused.value.field, refused.value.value) == ("expression", expression)
