"""Typed JSON: structs are decoded and checked in one step, and a mistake is named with field, value and rule.

A stored document is declared once as :class:`msgspec.Struct`, each field with its type. The types below have
a rule in words, which messages and generated schemas use.
"""

from __future__ import annotations

import reprlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from datetime import date, datetime, time, timedelta
from decimal import Decimal
from functools import cache
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)
from uuid import UUID

import msgspec
from msgspec import Meta, Struct

from pytest_libero_max.errors import LiberoMaxError, ReportError, did_you_mean

LARGEST = 2**63 - 1
"""Largest count or seed, so that all of them fit into NumPy's integers."""

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 120

_NOT_JSON = (bytes, bytearray, datetime, date, time, timedelta, Decimal, UUID)
"""Types that msgspec would write as text."""

AnyStruct = TypeVar("AnyStruct", bound="Document")


def rule(words: str, **limits: Any) -> Meta:
    """Limits of a value, and the words that follow "must be" in a message."""
    return Meta(extra={"rule": words}, **limits)


Text = Annotated[str, rule("text that is not empty", min_length=1)]
Word = Annotated[str, rule("a non-empty string", min_length=1)]
_CONTROLS = r"\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069"
Name = Annotated[
    str, rule("a non-empty string of printable text on one line", pattern=rf"^[^{_CONTROLS}]+$(?!\n)")
]
FileName = Annotated[
    str,
    rule(
        "a non-empty string of printable text on one line without slashes",
        pattern=rf"^[^/\\{_CONTROLS}]+$(?!\n)",
    ),
]
"""Name of a pair, of which names of files are made."""
AnyText = Annotated[str, rule("text")]
Flag = Annotated[bool, rule("true or false")]
Count = Annotated[int, rule("an integer of at least 0", ge=0, le=LARGEST)]
Positive = Annotated[int, rule("an integer of at least 1", ge=1, le=LARGEST)]
Length = Annotated[float, rule("a length in metres above 0", gt=0, le=sys.float_info.max)]
Distance = Annotated[float, rule("a number of at least 0", ge=0, le=LARGEST)]
Share = Annotated[float, rule("a number from 0 to 1", ge=0, le=1)]
Sha256 = Annotated[str, rule("64 hexadecimal digits", pattern="^[0-9a-f]{64}$")]
Proof = Annotated[str, rule("hexadecimal digits", pattern="^[0-9a-f]+$")]
SourceName = Annotated[str, rule("letters, digits and underscores", pattern="^[A-Za-z0-9_]+$")]
Difficulty = Annotated[int, rule("1 or 2 or 3 or 4 or 5", ge=1, le=5)]
Variant = Annotated[int, rule("0 or 1", ge=0, le=1)]
Object = Annotated[dict[str, Any], rule("an object")]
Texts = Annotated[tuple[str, ...], rule("a list of texts")]
NamedTexts = Annotated[dict[str, str], rule("an object of texts")]
Counts = Annotated[dict[str, Count], rule("an object of integers of at least 0")]

MOST_LEVELS = 8
"""Most lists and objects in each other in a :data:`Plain` value; ours have five."""

Whole = Annotated[int, Meta(ge=-LARGEST, le=LARGEST)]
Finite = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
Scalar = bool | Whole | Finite | str | None
"""A JSON value that is neither list nor object; sums and squares of its numbers stay finite."""

if TYPE_CHECKING:
    Plain = Any
else:
    Plain = Scalar
    for _ in range(MOST_LEVELS - 1):  # msgspec has no recursive type; a decoder doubles with each level
        Plain = Scalar | list[Plain] | dict[str, Plain]

PlainObject = Annotated[
    dict[str, Plain],
    Meta(
        extra={"rule": f"an object with numbers up to 2^63 - 1 and at most {MOST_LEVELS} levels"},
        extra_json_schema={"plain": True},
    ),
]
"""A stored object of no declared fields: a recursion over it ends, and no number of it overflows."""


class Document(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A stored JSON object: exactly these fields, each of its type."""

    NOUN: ClassVar[str] = "object"
    """Its name in messages."""


def decode_json(content: bytes | str, cure: str) -> Any:
    """Decode JSON to plain values: finite numbers, no constant that JSON does not know.

    Args:
        cure: Advice where it is not JSON; ends the message.

    Raises:
        ReportError: It is something else.
    """
    try:
        return msgspec.json.decode(content)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ReportError(f"not JSON ({error}). {cure}") from error


def decode(content: bytes, kind: type[AnyStruct]) -> AnyStruct:
    """Decode a struct from JSON, or raise ReportError."""
    try:
        decoded: AnyStruct = _decoder(kind).decode(content)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return convert(decode_json(content, "The line is damaged."), kind)
    return decoded


def convert(values: Any, kind: type[AnyStruct]) -> AnyStruct:
    """Return plain JSON values as a struct, or raise ReportError."""
    try:
        return msgspec.convert(values, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        _checked_inside(values, kind, f"{kind.NOUN}: ", ReportError)
        raise ReportError(f"The {kind.NOUN} cannot be read: {error}.") from None


def checked(value: Any, kind: Any, where: str, error: type[LiberoMaxError]) -> Any:
    """Return a plain value as a type: lists as tuples, numbers as floats, objects as structs.

    Args:
        where: Name of the value in a message, a place in words where it ends in ``": "``.

    Raises:
        LiberoMaxError: Of that class: the value, or one inside it, breaks the rule of its type. It names it.
    """
    try:
        return msgspec.convert(value, kind)
    except (msgspec.ValidationError, RecursionError):
        return _checked_inside(value, kind, where, error)


def _checked_inside(value: Any, kind: Any, where: str, error: type[LiberoMaxError]) -> Any:
    """Refuse what is wrong inside a value; a number of NumPy's is none of msgspec's, but right."""
    plain = _plain_type(kind)
    if plain == dict[str, Any] and not isinstance(value, dict):
        raise error(f"{where.removesuffix(': ')} must be a JSON object, not {type(value).__name__}.")
    if isinstance(value, float) and type(value) is not float and plain is float:
        return checked(float(value), kind, where, error)
    if isinstance(plain, type) and issubclass(plain, Struct):
        return _checked_struct(value, plain, where, error)
    parts = get_args(plain)
    if get_origin(plain) is tuple and isinstance(value, list | tuple):
        if Ellipsis in parts:
            parts = parts[:1] * len(value)
        if len(parts) == len(value):
            items = [
                checked(item, part, f"{where}[{i}]", error)
                for i, (item, part) in enumerate(zip(value, parts, strict=True))
            ]
            if fits(items, kind):
                return tuple(items)
    if isinstance(value, dict) and parts and isinstance(parts[-1], type) and issubclass(parts[-1], Struct):
        for key, item in value.items():
            checked(item, parts[-1], f"{where}.{key}", error)
    elif isinstance(value, dict) and fits({}, kind):
        for key, item in value.items():
            if not fits({key: item}, kind):
                raise _wrong(f"{where}.{key}", item, f", in what must be {words(kind)}.", error)
    if get_origin(plain) is Literal:
        is_text = isinstance(value, str) and value != ""
        what = f". {did_you_mean(value, parts)}" if is_text else ", but must be a non-empty string."
        raise _wrong(where, value, what, error)
    raise _wrong(where, value, f", but must be {words(kind)}.", error)


def _wrong(where: str, value: Any, rest: str, error: type[LiberoMaxError]) -> LiberoMaxError:
    """Return the error about a value, which may be long."""
    return error(f"{where}={shown(value)}{rest}", field=where.rpartition(": ")[2], value=value)


def _checked_struct(value: Any, kind: type[Struct], where: str, error: type[LiberoMaxError]) -> Any:
    require_fields(value, kind, where, error)
    hints = _hints(kind)
    at = where if where.endswith(": ") else f"{where}."
    values = {key: checked(value[key], hints[key], at + key, error) for key in _names(kind) if key in value}
    try:
        return kind(**values)
    except ValueError as broken:  # a rule that a struct checks itself
        raise error(f"{where.removesuffix(': ')}: {broken}.") from broken


def require_fields(value: Any, kind: type[Struct], where: str, error: type[LiberoMaxError]) -> None:
    """Check that a value is an object with the fields of a struct, whatever they hold.

    Raises:
        LiberoMaxError: Of the class given: it is none, lacks a field, or has an unknown one.
    """
    where = where.removesuffix(": ")
    if not isinstance(value, dict):
        raise error(f"{where} must be a JSON object, not {type(value).__name__}.")
    known, config = _names(kind), kind.__struct_config__
    for key in value if config.forbid_unknown_fields else ():
        if key not in known and key != config.tag_field:
            raise error(f"{where} has the unknown field {shown(key)}. {did_you_mean(str(key), known)}")
    missing = sorted(name for name, required in known.items() if required and name not in value)
    if missing:
        raise error(f"{where} lacks {', '.join(missing)}.")


@cache
def _names(kind: type[Struct]) -> dict[str, bool]:
    """Return the fields of a struct, True where they are required."""
    return {field.name: field.required for field in msgspec.structs.fields(kind)}


@cache
def _hints(kind: type[Struct]) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


def struct_of(kind: Any) -> type[Struct]:
    """Return the fields of a dataclass as a struct, which msgspec checks in one call.

    A field has the name that manifests give it, by the mapping ``spelling`` of the class where it has one.
    """
    return _struct_of(kind)


@cache
def _struct_of(kind: Any) -> type[Struct]:
    hints, spelling = get_type_hints(kind, include_extras=True), getattr(kind, "spelling", {})
    declared: list[Any] = []
    for item in fields(kind):
        hint = hints[item.name]
        default = () if item.default is MISSING else (item.default,)
        declared.append((spelling.get(item.name, item.name), hint, *default))
    return msgspec.defstruct(kind.__name__, declared, forbid_unknown_fields=True, kw_only=True)


def _plain_type(kind: Any) -> Any:
    """Return a type without its rule and without the None that it allows."""
    if get_origin(kind) is Annotated:
        return _plain_type(get_args(kind)[0])
    if get_origin(kind) in (Union, UnionType):
        parts = [part for part in get_args(kind) if part is not NoneType]
        return _plain_type(parts[0]) if len(parts) == 1 else kind
    return kind


def to_builtins(value: Struct) -> dict[str, Any]:
    """Return a struct as plain values, fields in their order; values that JSON lacks stay as they are."""
    plain: dict[str, Any] = msgspec.to_builtins(value, builtin_types=_NOT_JSON)
    return plain


def shown(value: object) -> str:
    """Return a value as text for a message, shortened."""
    return _SHORT.repr(value)


@cache
def _decoder(kind: type[AnyStruct]) -> msgspec.json.Decoder[AnyStruct]:
    return msgspec.json.Decoder(kind)


def require_plain(value: Any, where: str, levels: int) -> None:
    """Check that a value of no declared form has numbers that do not overflow, and an end.

    Args:
        levels: Most lists and objects in each other.

    Raises:
        ReportError: It has more levels, or a number beyond :data:`LARGEST`.
    """
    if isinstance(value, dict | list):
        if not levels:
            raise ReportError(f"{where} has too many lists and objects in each other.")
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            require_plain(part, f"{where}.{key}", levels - 1)
    elif isinstance(value, int | float) and not -LARGEST <= value <= LARGEST:
        raise ReportError(f"{where}={shown(value)}, but must be a number up to 2^63 - 1.")


def fits(value: Any, kind: Any) -> bool:
    """Return True if plain values are of a type and keep its rule."""
    try:
        msgspec.convert(value, kind)
    except (msgspec.ValidationError, RecursionError):
        return False
    return True


def words(hint: Any) -> str:
    """Return the rule of a type in words."""
    if get_origin(hint) is Annotated:
        for meta in hint.__metadata__:
            if isinstance(meta, Meta) and meta.extra and "rule" in meta.extra:
                return str(meta.extra["rule"])
    if get_origin(hint) in (Union, UnionType):
        parts = [part for part in get_args(hint) if part is not NoneType]
        either = " or ".join(map(words, parts))
        return f"{either}, or null" if NoneType in get_args(hint) else either
    if str(get_origin(hint)) == "typing.Literal":
        return " or ".join("null" if value is None else repr(value) for value in get_args(hint))
    origin = get_origin(hint) or hint
    if isinstance(origin, type) and issubclass(origin, Mapping | Document):
        return "an object"
    if isinstance(origin, type) and issubclass(origin, Sequence) and origin is not str:
        sized = origin is tuple and get_args(hint) and Ellipsis not in get_args(hint)
        return f"a list of {len(get_args(hint))} items" if sized else "a list"
    return {bool: "true or false", int: "an integer", float: "a number", str: "text"}.get(origin, "a value")
