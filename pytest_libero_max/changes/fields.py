"""Read a change from its manifest object and write it back; every field is checked.

The fields of a change's dataclass are the fields of its manifest object. A field whose default is None is
optional: absent from the object when it is None, so that reading and writing gives the same object.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any, ClassVar

from pytest_libero_max.errors import ChangeError, did_you_mean

if TYPE_CHECKING:
    from typing import Self

Vector3 = tuple[float, float, float]

FARTHEST_M = 10.0
"""Largest coordinate or offset. A scene is 3 m wide; a way to a place 1000 km off fills the memory."""

MOST_TIMES = 100.0
"""Largest factor of a brightness or colour."""


class ManifestFields:
    """Mixin of the frozen dataclasses that represent an object of a manifest."""

    operation: ClassVar[str]

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Self:
        """Build the value from its manifest object.

        Raises:
            ChangeError: A field is missing, unknown, or has a value that breaks its rule.
        """
        known = {field.name: field.default is MISSING for field in fields(cls)}  # type: ignore[arg-type]
        given = {key: value for key, value in raw.items() if key != "operation"}
        for key in given:
            if key not in known:
                raise ChangeError(
                    f"{cls.operation} has the unknown field {key!r}. {did_you_mean(str(key), known)}"
                )
        missing = [name for name, required in known.items() if required and name not in given]
        if missing:
            raise ChangeError(f"{cls.operation} lacks {', '.join(missing)}. Add what is missing.")
        return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        return {"operation": self.operation, **self.parameters()}

    def parameters(self) -> dict[str, Any]:
        """Return the manifest object without its ``operation``."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {name: _plain(value) for name, value in values.items() if value is not None}

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)  # the dataclasses are frozen; only __post_init__ calls this


def number(where: str, value: Any, low: float = -math.inf, high: float = math.inf) -> float:
    """Return a finite number within [low, high].

    Raises:
        ChangeError: It is not; the message begins with ``where``, the operation and field.
    """
    numeric = isinstance(value, int | float) and not isinstance(value, bool)
    # The comparison, unlike math.isfinite, also answers for an integer too long for a float.
    if not numeric or not abs(value) <= sys.float_info.max or not low <= value <= high:
        raise ChangeError.seen(where, value, f", but must be a finite number{_bounds(low, high)}.")
    return float(value)


def integer(where: str, value: Any, low: int = 0, high: float = math.inf) -> int:
    """Return an integer within [low, high].

    Raises:
        ChangeError: It is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ChangeError.seen(where, value, f", but must be an integer{_bounds(low, high)}.")
    return value


def text(where: str, value: Any) -> str:
    """Return a string that is not empty.

    Raises:
        ChangeError: It is not.
    """
    if not isinstance(value, str) or not value:
        raise ChangeError.seen(where, value, ", but must be a non-empty string.")
    return value


def flag(where: str, value: Any) -> bool:
    """Return a boolean.

    Raises:
        ChangeError: It is neither.
    """
    if not isinstance(value, bool):
        raise ChangeError.seen(where, value, ", but must be true or false.")
    return value


def items(where: str, value: Any, length: int) -> Sequence[Any]:
    """Return a list or tuple of exactly ``length`` items.

    Raises:
        ChangeError: It is not.
    """
    if not isinstance(value, list | tuple) or len(value) != length:
        raise ChangeError.seen(where, value, f", but must be a list of {length} items.")
    return value


def vector3(where: str, value: Any, low: float = -math.inf, high: float = math.inf) -> Vector3:
    """Return three finite numbers within [low, high].

    Raises:
        ChangeError: It is not.
    """
    x, y, z = (number(f"{where}[{i}]", item, low, high) for i, item in enumerate(items(where, value, 3)))
    return x, y, z


def place(where: str, value: Any) -> Vector3:
    """Return a position or an offset in a scene, m.

    Raises:
        ChangeError: It is not one, or farther than :data:`FARTHEST_M`.
    """
    return vector3(where, value, -FARTHEST_M, FARTHEST_M)


def offset(where: str, value: Any) -> float:
    """Return one coordinate of a position or an offset, m; see :func:`place`."""
    return number(where, value, -FARTHEST_M, FARTHEST_M)


def factor(where: str, value: Any) -> float:
    """Return a factor of a brightness or a colour.

    Raises:
        ChangeError: It is negative, or above :data:`MOST_TIMES`.
    """
    return number(where, value, 0.0, MOST_TIMES)


def factors3(where: str, value: Any) -> Vector3:
    """Return factors of red, green and blue."""
    return vector3(where, value, 0.0, MOST_TIMES)


def strength_of(operation: str, strength: float) -> float:
    """Return a strength within 0 to 1.

    Raises:
        ChangeError: It is not.
    """
    return number(f"strength of {operation}", strength, 0.0, 1.0)


def all_or_nothing(operation: str, strength: float) -> bool:
    """Return True if a change that cannot be scaled happens at this strength.

    Raises:
        ChangeError: ``strength`` is neither 0 nor 1.
    """
    s = strength_of(operation, strength)
    if s not in (0.0, 1.0):
        raise ChangeError.seen(
            "strength", strength, f", but {operation} is all or nothing: it happens or not. Use 0 or 1."
        )
    return s == 1.0


def _bounds(low: float, high: float) -> str:
    if math.isfinite(low) and math.isfinite(high):
        return f" from {low:g} to {high:g}"
    return f" of at least {low:g}" if math.isfinite(low) else ""


def _plain(value: Any) -> Any:
    if isinstance(value, ManifestFields):
        return value.parameters()
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value
