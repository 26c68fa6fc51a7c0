"""JSON as results are written, and nothing else."""

from __future__ import annotations

import json
from math import isfinite
from typing import Any

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.errors import ReportError
from pytest_libero_max.pairing.fields import shown


def decode_json(content: bytes, cure: str) -> Any:
    """Decode JSON as results are written: finite numbers, and no name twice in an object.

    Args:
        content: UTF-8.
        cure: What to do where it is not JSON; ends the message.

    Raises:
        ReportError: It is something else.
    """
    try:
        return _DECODER.decode(content.decode())
    except (ValueError, RecursionError) as error:
        raise ReportError(f"not JSON ({error}). {cure}") from error


def _once(pairs: list[tuple[str, Any]]) -> Json:
    values = dict(pairs)
    if len(values) != len(pairs):
        raise ValueError(f"a name occurs twice in an object that has {', '.join(map(shown, values))}")
    return values


def _finite(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise ValueError(f"{text} is no finite number")
    return value


_DECODER = json.JSONDecoder(object_pairs_hook=_once, parse_float=_finite, parse_constant=_finite)
