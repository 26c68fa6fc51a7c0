"""Read a change from its manifest object and write it back; every field is checked.

The fields of a change's dataclass are the fields of its manifest object. A field whose default is None is
optional: absent from the object when it is None, so that reading and writing gives the same object.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from msgspec import Meta

from pytest_libero_max.benchmark.structs import checked, require_fields, rule, struct_of
from pytest_libero_max.errors import ChangeError

if TYPE_CHECKING:
    from typing import Self

FARTHEST_M = 10.0
"""Largest coordinate or offset. A scene is 3 m wide; a way to a place 1000 km off fills the memory."""

MOST_TIMES = 100.0
"""Largest factor of a brightness or colour."""


def between(low: float, high: float) -> Meta:
    """Return the rule of a finite number within [low, high]."""
    ends = f" of at least {low:g}" if high == math.inf else f" from {low:g} to {high:g}"
    words = "a finite number" + ("" if low == -math.inf else ends)
    return rule(words, ge=max(low, -sys.float_info.max), le=min(high, sys.float_info.max))


Number = Annotated[float, between(-math.inf, math.inf)]
Share = Annotated[float, between(0.0, 1.0)]
Cosine = Annotated[float, between(-1.0, 1.0)]
Offset = Annotated[float, between(-FARTHEST_M, FARTHEST_M)]
"""One coordinate of a position or an offset in a scene, m."""
Seed = Annotated[int, rule("an integer of at least 0", ge=0)]
Degrees = Annotated[float, between(-180.0, 180.0)]
Times = Annotated[float, between(0.0, MOST_TIMES)]
"""Factor of a brightness or a colour."""
Vector3 = tuple[Number, Number, Number]
Place = tuple[Offset, Offset, Offset]
"""A position or an offset in a scene, m."""
Times3 = tuple[Times, Times, Times]
"""Factors of red, green and blue."""


class ManifestFields:
    """Mixin of the frozen dataclasses that represent an object of a manifest.

    A value of a field must be of the field's type and keep its rule. It is stored as that type has it: lists
    as tuples, numbers as floats.

    Raises:
        ChangeError: A value breaks the rule of its field.
    """

    operation: ClassVar[str]

    def __post_init__(self) -> None:
        kind = struct_of(type(self))
        given = {name: getattr(self, name) for name in kind.__struct_fields__}
        values = checked(given, kind, self.operation, ChangeError)
        for name in given:
            self._set(name, getattr(values, name))

    @classmethod
    def from_dict(cls, raw: Mapping[str, Any]) -> Self:
        """Build the value from its manifest object, or raise ChangeError."""
        given = {key: value for key, value in raw.items() if key != "operation"}
        require_fields(given, struct_of(cls), cls.operation, ChangeError)
        return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        return {"operation": self.operation, **self.parameters()}

    def parameters(self) -> dict[str, Any]:
        """Return the manifest object without its ``operation``."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {name: _plain(value) for name, value in values.items() if value is not None}

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)  # the dataclasses are frozen; only __post_init__ calls it


def strength_of(operation: str, strength: float) -> float:
    """Return a strength within 0 to 1, or raise ChangeError."""
    return float(checked(strength, Share, f"strength of {operation}", ChangeError))


def all_or_nothing(operation: str, strength: float) -> bool:
    """Return True if a change that cannot be scaled happens at this strength, or raise ChangeError."""
    s = strength_of(operation, strength)
    if s not in (0.0, 1.0):
        raise ChangeError.seen(
            "strength", strength, f", but {operation} is all or nothing: it happens or not. Use 0 or 1."
        )
    return s == 1.0


def _plain(value: Any) -> Any:
    if isinstance(value, ManifestFields):
        return value.parameters()
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value
