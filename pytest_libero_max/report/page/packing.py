"""Many similar JSON values in little space: their shapes once, their texts once, and what is left as rows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from pytest_libero_max.benchmark.documents import Json


def packed(values: Sequence[Any]) -> Json:
    """Pack JSON values; ``detail.js`` has the way back.

    Returns:
        ``shapes``: the distinct values with 0 for each number, boolean and null, and ``""`` for each text.
        ``texts``: the distinct texts. ``rows``: for each value the place of its shape, and what fills it in
        the order of the shape; for a text, its place.
    """
    shapes: dict[str, int] = {}
    texts: dict[str, int] = {}
    rows: list[list[Any]] = []
    for value in values:
        leaves: list[Any] = []
        shape = json.dumps(_shape(value, leaves, texts))
        rows.append([shapes.setdefault(shape, len(shapes)), *leaves])
    return {"shapes": [json.loads(shape) for shape in shapes], "texts": list(texts), "rows": rows}


def unpacked(values: Json) -> list[Any]:
    """Return the values that :func:`packed` was given; the page does the same in JavaScript."""
    return [
        _filled(values["shapes"][place], iter(leaves), values["texts"]) for place, *leaves in values["rows"]
    ]


def labelled(names: Sequence[str], order: Sequence[str] = ()) -> Json:
    """Return a column of names as its distinct names and the place of each.

    Args:
        names: One a row.
        order: The first of the distinct names in their order; the others follow by the alphabet.
    """
    there = set(names)
    labels = [name for name in order if name in there]
    labels += sorted(there - set(labels))
    places = {label: place for place, label in enumerate(labels)}
    return {"labels": labels, "at": [places[name] for name in names]}


def _shape(value: Any, leaves: list[Any], texts: dict[str, int]) -> Any:
    if isinstance(value, dict):
        return {key: _shape(part, leaves, texts) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_shape(part, leaves, texts) for part in value]
    if isinstance(value, str):
        leaves.append(texts.setdefault(value, len(texts)))
        return ""
    leaves.append(_short(value))
    return 0


def _short(value: Any) -> Any:
    """Return a number to four digits, which is what people read; the records have all of them."""
    if not isinstance(value, float):
        return value
    rounded = float(f"{value:.4g}")
    return int(rounded) if rounded.is_integer() else rounded


def _filled(shape: Any, leaves: Any, texts: Sequence[str]) -> Any:
    if isinstance(shape, dict):
        return {key: _filled(part, leaves, texts) for key, part in shape.items()}
    if isinstance(shape, list):
        return [_filled(part, leaves, texts) for part in shape]
    return texts[next(leaves)] if shape == "" else next(leaves)
