"""Columns of probes in a record: those of this package as their probes declare them, others as any probe may.

No module of another package is imported because a record names its probe. What such a probe yielded was
checked by its own schema when the pair was played.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from operator import itemgetter
from types import GenericAlias, MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
from msgspec import Meta, Struct

from pytest_libero_max.benchmark.documents import Json
from pytest_libero_max.benchmark.structs import LARGEST, Finite, Scalar, Whole, shown
from pytest_libero_max.errors import ReportError, counted, did_you_mean
from pytest_libero_max.pairing.probes.registry import own_schema

if TYPE_CHECKING:
    from pytest_libero_max.pairing.probes.probe import Column

if TYPE_CHECKING:
    Columns = dict[str, Any]
else:
    Columns = Annotated[dict[str, Scalar | list[Scalar]], Meta(extra_json_schema={"plain": True})]
    """Values of the columns of a probe, by name."""

_Get = Callable[[Json], Sequence[Any]]

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_STEPS = "steps"
_TYPES: Mapping[str, Any] = MappingProxyType({"bool": bool, "int": Whole, "float": Finite, "str": str})


def require_columns(probes: Mapping[str, Json], steps: int) -> None:
    """Check that the columns of the probes of an arm are what those probes yield, or raise ReportError.

    Args:
        probes: Columns by the name of their probe; each a scalar or a list of scalars.
        steps: Policy steps of the arm.
    """
    for name, columns in probes.items():
        layout = _layout(name)
        try:
            if layout is not None:
                layout.require(columns, steps)
            elif strange := [key for key in columns if not _NAME.fullmatch(key)]:
                raise ValueError(
                    f"column {shown(strange[0])}, but a name is lower-case letters, digits and _"
                )
        except ValueError as error:
            raise ReportError(f"probe {name!r}: {str(error).removesuffix('.')}.") from None


@dataclass(frozen=True)
class _Layout:
    """The declared columns of a probe, in the forms in which they are checked."""

    schema: tuple[Column, ...]
    """Its columns."""
    kind: type[Struct]
    """A struct of them."""
    lists: tuple[_Get, ...]
    """For each group of columns that have as many values: returns their values."""
    steps: tuple[_Get, _Get]
    """Returns the values of the lists, and of the other columns, that count steps of the arm."""

    def require(self, columns: Json, steps: int) -> None:
        """Check the columns of an arm, or raise ValueError."""
        try:
            msgspec.convert(columns, self.kind)
        except msgspec.ValidationError as error:
            self._explain(columns)
            raise ValueError(str(error)) from None
        if any(len(set(map(len, values(columns)))) > 1 for values in self.lists):
            from pytest_libero_max.pairing.probes.probe import require_lists

            require_lists(self.schema, columns)
        many, single = self.steps
        late = [count for count in chain(single(columns), *many(columns)) if count and count > steps]
        if late:
            raise ValueError(f"step {late[0]}, but the arm took {counted(steps, 'step')}")

    def _explain(self, columns: Json) -> None:
        """Name the first column that is wrong, or raise ValueError."""
        names = [column.name for column in self.schema]
        for key in columns:
            if key not in names:
                raise ValueError(f"the unknown column {shown(key)}. {did_you_mean(key, names)}")
        for column in self.schema:
            if column.name not in columns:
                raise ValueError(f"the column {column.name} is missing")
            column.checked(columns[column.name])


@cache
def _layout(name: str) -> _Layout | None:
    """Return the layout of a probe of this package; None of another one."""
    schema = own_schema(name)
    if schema is None:
        return None
    groups: dict[str, list[str]] = {}
    for column in schema:
        if column.along is not None:
            groups.setdefault(column.along, [column.along]).append(column.name)
    kind = msgspec.defstruct(
        name, [(column.name, _type(column)) for column in schema], forbid_unknown_fields=True
    )
    counts = [column for column in schema if column.unit == _STEPS and column.type == "int"]
    many, single = (_values_of([c.name for c in counts if c.many is asked]) for asked in (True, False))
    return _Layout(schema, kind, tuple(map(_values_of, groups.values())), (many, single))


def _values_of(names: Sequence[str]) -> _Get:
    """Return a function that looks up several columns; for one, ``itemgetter`` returns no tuple."""
    return itemgetter(*names) if len(names) > 1 else lambda columns: [columns[name] for name in names]


def _type(column: Column) -> Any:
    kind = _TYPES[column.type]
    if column.least is not None:
        number = int if column.type == "int" else float
        kind = Annotated[number, Meta(ge=number(column.least), le=LARGEST)]
    if column.optional:
        kind = kind | None
    return GenericAlias(list, (kind,)) if column.many else kind
