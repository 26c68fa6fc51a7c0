from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pytest_libero_max.errors import AdapterError
from pytest_libero_max.policies.transforms.steps import (
    ACTION_STEPS,
    INPUT_STEPS,
    NEEDS_ARGUMENT,
    TEXT_STEPS,
    parse_steps,
)


def run(value: Any, steps: list[Any], known: Any) -> Any:
    for step in parse_steps(steps, known, "here"):
        value = step(value)
    return value


def test_steps_are_applied_in_their_order() -> None:
    image = np.zeros((16, 16, 3), dtype=np.uint8)
    image[:8, :8] = 255
    result = run(image, ["rotate_180", {"resize_area": 2}], INPUT_STEPS)
    assert result[:, :, 0].tolist() == [[0, 0], [0, 255]]


def test_texts_are_changed_by_steps_as_well() -> None:
    steps = ["lower", {"replace": ["black bowl", "bowl"]}, "capitalise", {"template": "> {instruction}"}]
    assert run("Pick the BLACK bowl", steps, TEXT_STEPS) == "> Pick the bowl"


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (["rotate180"], "Did you mean 'rotate_180'"),
        (["resize_area"], r"written \{ resize_area = ... \}"),
        ([{"rotate_180": 1}], "written 'rotate_180'"),
        ([{"resize_area": 1, "first": 2}], "no step"),
        ([4], "no step"),
        ("rotate_180", "must be a list"),
    ],
)
def test_what_is_no_step_is_told_so(steps: Any, message: str) -> None:
    with pytest.raises(AdapterError, match=f"here.*{message}"):
        parse_steps(steps, INPUT_STEPS, "here")


@pytest.mark.parametrize(
    ("value", "step"),
    [
        (np.zeros(3), "rotate_180"),
        ("text", "sine_cosine"),
        (np.zeros(3), "png_file"),
        (np.zeros(3), {"pad_to": "four"}),
        (np.zeros((4, 4, 3), np.uint8), {"resize_area": 2.5}),
    ],
)
def test_a_step_that_does_not_fit_is_named(value: Any, step: Any) -> None:
    name = step if isinstance(step, str) else next(iter(step))
    with pytest.raises(AdapterError, match=f"step '{name}'"):
        run(value, [step], INPUT_STEPS)


def test_every_step_that_needs_an_argument_exists() -> None:
    assert {*INPUT_STEPS, *TEXT_STEPS, *ACTION_STEPS} >= NEEDS_ARGUMENT
