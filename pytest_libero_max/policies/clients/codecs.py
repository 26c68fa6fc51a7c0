"""Codecs of arrays in messages. Nothing here unpickles, and every size is checked before it is used.

Whatever cannot be read is a :class:`ServerError`.

Four dialects of msgpack write an array as a map. A server understands its own alone, so each protocol writes
one; all are read everywhere, because their maps cannot be mistaken for each other. JSON has one of its own.
"""

from __future__ import annotations

import base64
import binascii
import io
import json
import math
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.array_files import array_of
from pytest_libero_max.errors import ServerError, counted

MOST_BYTES = 64 * 2**20
"""Size of the largest message that is read, bytes. A chunk of actions has some kilobytes."""

MOST_PARTS = 2**18
"""Largest number of lists, maps and entries of maps in a message. Python needs gigabytes for millions."""

MOST_VALUES = 2**22
"""Largest number of values in the lists of a message: an image of 1024 x 1024 as numbers has 3 million."""

NPY_MAGIC = b"\x93NUMPY"
"""Begins a NumPy file."""

_KINDS = "biuf"
_MOST_DIMENSIONS = 8
_DTYPE = re.compile(r"[<>|=]?[a-z?]{1,10}[0-9]{0,3}")
"""NumPy's names of plain types. Others are expressions, which it would parse."""

AnyArray = NDArray[Any]


@dataclass(frozen=True)
class Dialect:
    """One way to write an array as a map."""

    encode: Callable[[AnyArray], dict[Any, Any]]
    decode: Callable[[dict[Any, Any]], Any]
    """Returns the value of a map: itself, unless it is an array."""


def pack(value: Any, dialect: Dialect) -> bytes:
    """Return a msgpack document."""
    import msgpack

    packed: bytes = msgpack.packb(value, default=_sent_as(dialect.encode))
    return packed


def unpack(content: bytes | str, dialect: Dialect) -> Any:
    """Return the value of a msgpack document."""
    import msgpack

    parts = values = 0

    def counted_list(part: list[Any]) -> list[Any]:
        nonlocal parts, values
        parts, values = parts + 1, values + len(part)
        _check_counts(parts, values)
        return part

    def counted_map(part: dict[Any, Any]) -> Any:
        nonlocal parts
        parts += 1 + len(part)
        _check_counts(parts, values)
        return dialect.decode(part)

    if isinstance(content, str):
        raise ServerError(f"expected a binary message, but got text: {shortened(content)}")
    _check_size(len(content))
    try:
        return msgpack.unpackb(
            content,
            object_hook=counted_map,
            list_hook=counted_list,
            max_array_len=MOST_VALUES,
            max_map_len=MOST_PARTS,
            ext_hook=_no_extension,
            max_ext_len=0,  # nor times, which are extensions without the hook
            raw=False,
            strict_map_key=True,
        )
    except ServerError:
        raise
    except Exception as error:  # msgpack has a dozen of its own, some of them no ValueError
        raise ServerError(
            f"a message of {len(content)} bytes is no msgpack document ({type(error).__name__}: {error})"
        ) from error


def foreign_arrays(content: bytes, dialect: Dialect) -> list[dict[Any, Any]]:
    """Return the maps of a msgpack document that are arrays in another dialect than this one."""
    import msgpack

    own, foreign = dialect.encode(np.zeros(1)).keys(), list[dict[Any, Any]]()

    def look(part: dict[Any, Any]) -> dict[Any, Any]:
        if part.keys() != own and isinstance(decode(part), np.ndarray):
            foreign.append(part)
        return part

    msgpack.unpackb(content, object_hook=look, raw=False, strict_map_key=True)
    return foreign


def _no_extension(code: int, data: bytes) -> Any:
    raise ServerError(f"a msgpack extension of type {code}, of which none is read")


def to_json(value: Any, encode: Callable[[AnyArray], Any]) -> bytes:
    """Return a JSON document."""
    return json.dumps(value, default=_sent_as(encode), allow_nan=False).encode()


def _sent_as(encode: Callable[[AnyArray], Any]) -> Callable[[Any], Any]:
    """Return plain values in place of NumPy's, for encoders to call."""

    def default(item: Any) -> Any:
        if isinstance(item, np.ndarray):
            return encode(_plain(item))
        if isinstance(item, np.generic):
            return item.item()
        raise TypeError(f"a {type(item).__name__} cannot be sent")

    return default


def from_json(content: bytes) -> Any:
    """Return the value of a JSON document, arrays of the json-numpy dialect included."""
    _check_size(len(content))
    # The parser of JSON has no limits, so brackets and commas are counted first, also those within texts.
    _check_counts(sum(map(content.count, (b"[", b"{", b":"))), content.count(b","))
    try:
        return json.loads(content, object_hook=JSON_NUMPY.decode)
    except (ValueError, RecursionError) as error:
        raise ServerError(
            f"an answer of {len(content)} bytes is no JSON document ({type(error).__name__}: {error}); "
            f"it begins with {shortened(content.decode('utf-8', 'replace'))}"
        ) from error


def as_lists(array: AnyArray) -> Any:
    """Return an array as nested lists."""
    return array.tolist()


def as_json_numpy_text(array: AnyArray) -> str:
    """Return an array as a string that holds a JSON document of the json-numpy dialect."""
    return json.dumps(JSON_NUMPY.encode(array))


def shortened(text: str) -> str:
    """Return the beginning of a text in quotes, on one line."""
    return repr(text if len(text) <= 200 else text[:200] + "...")


def array_from(data: Any, dtype: Any, shape: Any) -> AnyArray:
    """Return an array from its bytes, after checks of its type and shape."""
    try:
        kind = np.dtype(dtype) if isinstance(dtype, str) and _DTYPE.fullmatch(dtype) else None
    except (TypeError, ValueError):
        kind = None
    if kind is None or kind.kind not in _KINDS or kind.subdtype is not None:
        raise ServerError(f"an array of dtype {shortened(str(dtype))}, but only plain real numbers are read")
    if not isinstance(data, bytes):
        raise ServerError(f"the data of an array are a {type(data).__name__}, but must be bytes")
    axes = list(shape) if isinstance(shape, list | tuple) else None
    if (
        axes is None
        or len(axes) > _MOST_DIMENSIONS
        or not all(isinstance(n, int) and not isinstance(n, bool) and n >= 0 for n in axes)
        or math.prod(axes) * kind.itemsize != len(data)
    ):
        raise ServerError(
            f"an array of shape {shortened(str(shape))} and dtype {kind} with {counted(len(data), 'byte')}"
        )
    return np.frombuffer(data, dtype=kind).reshape(axes).copy()


def _plain(array: AnyArray) -> AnyArray:
    if array.dtype.kind not in _KINDS:
        raise TypeError(f"an array of dtype {array.dtype} cannot be sent, only real numbers")
    return np.asarray(array, order="C")


def _check_size(size: int) -> None:
    if size > MOST_BYTES:
        raise ServerError(f"a message of {size} bytes, but at most {MOST_BYTES} are read")


def _check_counts(parts: int, values: int) -> None:
    if parts > MOST_PARTS:
        raise ServerError(f"a message of more than {MOST_PARTS} lists and maps")
    if values > MOST_VALUES:
        raise ServerError(f"a message of more than {MOST_VALUES} values in lists")


# Reading.


def decode(value: dict[Any, Any]) -> Any:
    """Return the value of a map in msgpack: an array where a dialect writes one so, otherwise the map."""
    # openpi and msgpack-numpy write their keys as bytes, vla-eval as text.
    keys = {(key.decode("ascii", "replace") if isinstance(key, bytes) else key): key for key in value}

    def part(name: str) -> Any:
        return value.get(keys.get(name, name))

    if "__image__" in keys:
        raise ServerError("an image where actions were expected")
    if len(keys) < len(value) and keys.keys() & _MARKS:
        raise ServerError("an array of which a key is there twice, as text and as bytes")
    if "__ndarray__" in keys:
        return array_from(part("data"), part("dtype"), part("shape"))
    if "__npgeneric__" in keys:
        return _number(part("data"))
    if "__ndarray_class__" in keys:
        return npy_array(part("as_npy"))
    if {"nd", "type", "data"} <= keys.keys():
        return _msgpack_numpy(part)
    if {"data", "dtype", "shape"} == keys.keys():  # no word marks it, and its size leaves no doubt
        with suppress(ServerError):
            return array_from(part("data"), part("dtype"), part("shape"))
    return value


def npy_array(content: Any) -> AnyArray:
    """Return the array of a NumPy file."""
    if not isinstance(content, bytes):
        raise ServerError(f"a NumPy file that is a {type(content).__name__}, but must be bytes")
    try:
        array = array_of(content)
    except ValueError as error:
        raise ServerError(f"a NumPy file that cannot be read ({error})") from error
    if array.dtype.kind not in _KINDS:
        raise ServerError(f"a NumPy file of {array.dtype}, but only plain real numbers are read")
    return array


def _msgpack_numpy(part: Callable[[str], Any]) -> Any:
    dtype = part("type")
    dtype = dtype.decode("ascii", "replace") if isinstance(dtype, bytes) else dtype
    if part("kind") not in (b"", "", None):
        raise ServerError("an array of objects or records, but only plain real numbers are read")
    if part("nd") is not True:
        return array_from(part("data"), dtype, ()).item()
    return array_from(part("data"), dtype, part("shape"))


def _number(value: Any) -> int | float:
    if not isinstance(value, int | float):
        raise ServerError(f"a number that is a {type(value).__name__}")
    return value


_MARKS = frozenset({"__ndarray__", "__npgeneric__", "__ndarray_class__", "nd"})


# Writing.


def _vla_eval_encode(array: AnyArray) -> dict[Any, Any]:
    return {
        "__ndarray__": True,
        "data": array.tobytes(),
        "dtype": array.dtype.str,
        "shape": list(array.shape),
    }


def _openpi_encode(array: AnyArray) -> dict[Any, Any]:
    return {key.encode(): value for key, value in _vla_eval_encode(array).items()}


def _msgpack_numpy_encode(array: AnyArray) -> dict[Any, Any]:
    return {
        b"nd": True,
        b"type": array.dtype.str,
        b"kind": b"",
        b"shape": list(array.shape),
        b"data": array.tobytes(),
    }


def _npy_encode(array: AnyArray) -> dict[Any, Any]:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return {"__ndarray_class__": True, "as_npy": content.getvalue()}


OPENPI = Dialect(_openpi_encode, decode)
"""``__ndarray__``, ``data``, ``dtype``, ``shape``, the keys being bytes."""

VLA_EVAL = Dialect(_vla_eval_encode, decode)
"""The same words, the keys being text."""

MSGPACK_NUMPY = Dialect(_msgpack_numpy_encode, decode)
"""``nd``, ``type``, ``kind``, ``shape``, ``data``, the keys being bytes: msgpack-numpy, of GR00T N1.7."""

NPY = Dialect(_npy_encode, decode)
"""``__ndarray_class__`` with the content of a ``.npy`` file: GR00T N1.5 and N1.6."""


# json-numpy.


def _json_numpy_encode(array: AnyArray) -> dict[str, Any]:
    return {
        "__numpy__": base64.b64encode(array.tobytes()).decode("ascii"),
        "dtype": array.dtype.str,
        "shape": list(array.shape),
    }


def _json_numpy_decode(value: dict[Any, Any]) -> Any:
    if "__numpy__" not in value:
        return value
    text = value["__numpy__"]
    try:
        data = base64.b64decode(text, validate=True) if isinstance(text, str) else None
    except (binascii.Error, ValueError) as error:
        raise ServerError(f"an array whose data are not base64 ({error})") from error
    return array_from(data, value.get("dtype"), value.get("shape"))


JSON_NUMPY = Dialect(_json_numpy_encode, _json_numpy_decode)
"""``__numpy__`` with base64, ``dtype``, ``shape``."""
