"""Reads the actions of an answer, alike from a policy in process and from a server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.errors import class_name, text_of

Rows = NDArray[np.float64]

_USUAL_KEYS = ("actions", "action", "action_chunk", "action_pred", "predicted_actions", "normalized_actions")
"""Names under which policies return actions in a dict, the usual ones first."""

_MOST_KEYS = 8


class Unplayable(ValueError):
    """Something that holds no actions.

    Attributes:
        what: What came, with its article: ``a dict with the keys ['actions']``.
        cure: A sentence with the way to repair it; empty where there is none.
        key: Key of the actions in a dict; None for anything else.
        rule: The rule that it breaks; empty for that of the shape and the type.
    """

    def __init__(self, what: str, cure: str = "", key: str | None = None, rule: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.cure = cure
        self.key = key
        self.rule = rule


def read_rows(value: Any) -> Rows:
    """Return actions as (n, d) float64, C-contiguous and fresh.

    A single action, (d,), is one row. Leading axes of length 1 are those of a batch and are left out.
    """
    rows = read_numbers(value)
    shape = rows.shape
    while rows.ndim > 2 and len(rows) == 1:
        rows = rows[0]
    if rows.ndim == 1:
        rows = rows.reshape(1, -1)
    if rows.ndim != 2:
        raise Unplayable(f"actions of shape {shape}", "A batch of one is read, and no larger one.")
    finite = np.isfinite(rows)
    if not finite.all():
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise Unplayable(
            f"actions[{row}, {column}]={rows[row, column]}",
            "Find where the policy divides by zero or overflows.",
            rule="every component must be finite",
        )
    return np.array(rows, dtype=np.float64, order="C")


def read_numbers(value: Any) -> Rows:
    """Return an array of real numbers as float64, of any shape."""
    if isinstance(value, Mapping):
        raise _of_dict(value)
    if isinstance(value, str | bytes | bytearray):
        raise Unplayable(f"a {class_name(value)} of length {len(value)}")
    try:
        array = np.asarray(value)
    except Exception as error:  # __array__ is code of the adapter, and may raise anything
        raise Unplayable(f"a {class_name(value)} that is no array ({text_of(error)})") from error
    if array.dtype.kind not in "fiu":
        raise Unplayable(
            f"{class_name(value)} of dtype {array.dtype}",
            "Rows of different lengths, tensors and None make an array of objects: stack numbers."
            if array.dtype.kind == "O"
            else "",
        )
    _require_unmasked(value)
    with np.errstate(all="ignore"):  # what is not finite is refused later
        return array.astype(np.float64)


def _require_unmasked(value: Any) -> None:
    """Refuse masked values, which a plain array would take for numbers."""
    if not (
        np.ma.isMaskedArray(value)
        or (isinstance(value, list | tuple) and any(map(np.ma.isMaskedArray, value)))
    ):
        return
    mask = np.ma.getmaskarray(np.ma.asanyarray(value))
    if mask.any():
        first = tuple(int(i) for i in np.argwhere(mask)[0])
        raise Unplayable(
            f"a masked array in which actions{list(first)} is masked",
            "A masked value is no action: return the rows without, answer[~answer.mask.any(axis=1)].data.",
        )


def likely_key(value: Mapping[Any, Any]) -> str | None:
    """Return the key of a dict under which its actions seem to lie; None where none holds an array."""
    likely = (name for name in (*_USUAL_KEYS, *value) if name in value and is_array(value[name]))
    return next((str(name) for name in likely), None)


def is_array(value: Any) -> bool:
    """Return True if a value is read as an array of numbers, with one axis or more."""
    try:
        return not isinstance(value, Mapping) and read_numbers(value).ndim > 0
    except Unplayable:
        return False


def _of_dict(value: Mapping[Any, Any]) -> Unplayable:
    names = sorted(map(str, value))
    seen = ", ".join(map(repr, names[:_MOST_KEYS])) + (", ..." if len(names) > _MOST_KEYS else "")
    key = likely_key(value)
    cure = "" if key is None else f"Take them out of it: [{key!r}]."
    return Unplayable(f"a dict with the keys [{seen}]", cure, key)
