"""Plain values as the types of dataclasses and structs, by the rules of their fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from msgspec import Struct

from pytest_libero_max.benchmark.structs import Count, Positive, Text, checked, rule, struct_of
from pytest_libero_max.errors import ManifestError


class Inner(Struct, forbid_unknown_fields=True):
    size: Positive
    mode: Literal["fast", "slow"] = "fast"


class Outer(Struct, forbid_unknown_fields=True):
    inner: tuple[Inner, ...]
    place: Annotated[tuple[float, float], rule("a place")] = (0.0, 0.0)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([], r"^outer must be a JSON object, not list"),
        ({}, r"^outer lacks inner"),
        ({"inner": [], "inners": 1}, r"^outer has the unknown field 'inners'\. Did you mean 'inner'"),
        ({"inner": [{"size": 1}, {"size": 0}]}, r"^outer\.inner\[1\]\.size=0, but must be an integer of at"),
        ({"inner": [{"size": 1, "mode": "fats"}]}, r"inner\[0\]\.mode='fats'\. Did you mean 'fast'"),
        ({"inner": [], "place": [1]}, r"place=\[1\], but must be a place"),
        ({"inner": [], "place": [1, "a"]}, r"place\[1\]='a', but must be a number"),
    ],
)
def test_what_is_wrong_is_named_by_its_place(value: Any, message: str) -> None:
    with pytest.raises(ManifestError, match=message):
        checked(value, Outer, "outer", ManifestError)


def test_numbers_of_numpy_are_numbers() -> None:
    x, y = checked((np.float64(0.5), 1), tuple[float, float], "place", ManifestError)
    assert (type(x), x, type(y), y) == (float, 0.5, float, 1.0)


def test_the_fields_of_a_dataclass_are_those_of_a_struct_by_their_spelling() -> None:
    @dataclass
    class Wait:
        steps: Count = 0
        entity: Text = "plate_1"

        spelling = {"entity": "value"}  # noqa: RUF012 - no field

    found = checked({"value": "bowl_1"}, struct_of(Wait), "wait", ManifestError)
    assert (found.steps, found.value) == (0, "bowl_1")
