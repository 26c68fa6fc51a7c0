"""Codecs: what is written is read again, and whatever else is read ends in a ServerError or a plain value."""

from __future__ import annotations

import contextlib
import io
import json
import pickle
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from pytest_libero_max.errors import ServerError
from pytest_libero_max.policies.clients import codecs
from pytest_libero_max.policies.clients.codecs import (
    JSON_NUMPY,
    MSGPACK_NUMPY,
    NPY,
    OPENPI,
    VLA_EVAL,
    Dialect,
)

PACKED = {"openpi": OPENPI, "vla-eval": VLA_EVAL, "msgpack-numpy": MSGPACK_NUMPY, "npy": NPY}

ARRAYS = npst.arrays(
    st.sampled_from(["<f8", "<f4", "|u1", "<i8", "|b1", ">f4"]),
    npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


@pytest.mark.parametrize("dialect", PACKED.values(), ids=PACKED)
@given(array=ARRAYS)
@settings(max_examples=15)
def test_an_array_is_read_as_it_was_written(dialect: Dialect, array: Any) -> None:
    again = codecs.unpack(codecs.pack({"a": [array, 1.5, "text", None]}, dialect), dialect)["a"]
    assert again[1:] == [1.5, "text", None]
    assert (again[0].dtype, again[0].shape) == (array.dtype, array.shape)
    assert again[0].tobytes() == array.tobytes()


@given(array=ARRAYS)
@settings(max_examples=15)
def test_json_numpy_is_read_as_it_was_written(array: Any) -> None:
    again = codecs.from_json(codecs.to_json({"a": array}, codecs.JSON_NUMPY.encode))["a"]
    assert (again.dtype, again.shape, again.tobytes()) == (array.dtype, array.shape, array.tobytes())
    text = json.loads(codecs.to_json({"a": array}, codecs.as_json_numpy_text))["a"]
    assert codecs.from_json(text.encode()).tobytes() == array.tobytes()


def test_an_array_in_fortran_order_is_read_from_a_numpy_file() -> None:
    array = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    again = codecs.unpack(codecs.pack(array, NPY), NPY)
    assert np.array_equal(again, array)
    content = io.BytesIO()
    np.save(content, array)
    again = codecs.unpack(msgpack.packb({"__ndarray_class__": True, "as_npy": content.getvalue()}), NPY)
    assert np.array_equal(again, array)


def test_numbers_of_numpy_are_sent_as_numbers_and_objects_not_at_all() -> None:
    assert codecs.unpack(codecs.pack([np.float32(0.5), np.int64(3), np.bool_(True)], OPENPI), OPENPI) == [
        0.5,
        3,
        True,
    ]
    for unsendable in (np.array([object()]), object()):
        with pytest.raises(TypeError, match="cannot be sent"):
            codecs.pack(unsendable, OPENPI)


@pytest.mark.parametrize("written", PACKED.values(), ids=PACKED)
@pytest.mark.parametrize("read", PACKED.values(), ids=PACKED)
def test_every_dialect_is_read_in_every_protocol(written: Dialect, read: Dialect) -> None:
    array = np.arange(14, dtype=np.float32).reshape(2, 7)
    again = codecs.unpack(codecs.pack({"actions": array}, written), read)["actions"]
    assert (again.dtype, again.tolist()) == (array.dtype, array.tolist())


def test_an_array_without_a_mark_is_read_where_its_size_leaves_no_doubt() -> None:
    array = {"data": np.zeros(7).tobytes(), "dtype": "<f8", "shape": [1, 7]}
    for keys in (array, {key.encode(): value for key, value in array.items()}):
        assert codecs.unpack(msgpack.packb(keys), OPENPI).shape == (1, 7)
    for other in ({**array, "shape": [2, 7]}, {**array, "note": "x"}, {**array, "dtype": "bfloat16"}):
        assert codecs.unpack(msgpack.packb(other), OPENPI) == other


def test_a_key_as_text_and_as_bytes_is_refused() -> None:
    twice = {**VLA_EVAL.encode(np.zeros(7)), **OPENPI.encode(np.ones(7))}
    with pytest.raises(ServerError, match=r"there twice"):
        codecs.unpack(msgpack.packb(twice), OPENPI)


class Bomb:
    """What unpickling would run."""

    def __reduce__(self) -> Any:
        return pytest.fail, ("unpickled",)


def _hostile(dialect: Dialect) -> list[Any]:
    """Maps that look like arrays of a dialect and are none."""
    proper = dialect.encode(np.arange(4.0))
    if "as_npy" in proper:
        objects = io.BytesIO()
        np.save(objects, np.array([Bomb()], dtype=object), allow_pickle=True)
        records = io.BytesIO()
        np.save(records, np.zeros(2, dtype=[("a", "f8")]))
        cut = proper["as_npy"][:-1]
        files = (
            objects.getvalue(),
            records.getvalue(),
            cut,
            b"",
            b"\x93NUMPY\x01\x00",
            pickle.dumps(Bomb()),
            4,
        )
        return [{**proper, "as_npy": file} for file in files]
    keys = {(key.decode() if isinstance(key, bytes) else key): key for key in proper}
    data, shape = keys["data"], keys["shape"]
    dtype = keys.get("dtype", keys.get("type"))
    changes: list[dict[Any, Any]] = [
        {dtype: "|O", data: pickle.dumps(Bomb())},
        {dtype: "V8"},
        {dtype: "f8,f8"},
        {dtype: "no type"},
        {dtype: ","},
        {dtype: "(" * 200},
        {dtype: ""},
        {dtype: 4},
        {dtype: "M8[s]"},
        {data: proper[data][:-1]},
        {data: "text"},
        {data: None},
        {shape: [5]},
        {shape: [-1]},
        {shape: [2**62, 2**62]},
        {shape: [1] * 40},
        {shape: "four"},
        {shape: [4.0]},
    ]
    if "kind" in keys:
        changes.append({keys["kind"]: b"O", dtype: "|O", data: pickle.dumps(Bomb())})
    return [{**proper, **change} for change in changes]


@pytest.mark.parametrize("dialect", PACKED.values(), ids=PACKED)
def test_a_map_that_only_looks_like_an_array_is_refused_and_nothing_is_unpickled(dialect: Dialect) -> None:
    for value in _hostile(dialect):
        with pytest.raises(ServerError):
            codecs.unpack(msgpack.packb({"actions": value}), dialect)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        '{"__numpy__": "!!", "dtype": "<f8", "shape": [1]}',
        '{"__numpy__": "AAAA", "dtype": "<f8", "shape": [1]}',
        '{"__numpy__": 4, "dtype": "<f8", "shape": [1]}',
        '{"__numpy__": "AAAA", "dtype": "|O", "shape": [1]}',
        '{"__numpy__": "AAAA", "dtype": ",", "shape": [1]}',
        "[" * 100_000,
    ],
)
def test_json_that_is_damaged_or_nested_too_deeply_is_refused(text: str) -> None:
    with pytest.raises(ServerError):
        codecs.from_json(text.encode())


def test_deep_nesting_and_text_and_too_much_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ServerError, match="no msgpack"):
        codecs.unpack(b"\x91" * 100_000, OPENPI)
    with pytest.raises(ServerError, match="expected a binary message"):
        codecs.unpack("text", OPENPI)
    monkeypatch.setattr(codecs, "MOST_BYTES", 10)
    with pytest.raises(ServerError, match="at most 10"):
        codecs.unpack(bytes(11), OPENPI)
    with pytest.raises(ServerError, match="at most 10"):
        codecs.from_json(b" " * 11)


@pytest.mark.parametrize("dialect", PACKED.values(), ids=PACKED)
@given(data=st.data())
@settings(max_examples=40)
def test_any_bytes_give_a_value_or_a_server_error(dialect: Dialect, data: st.DataObject) -> None:
    sound = codecs.pack({"actions": np.arange(14.0).reshape(2, 7), "n": 1}, dialect)
    place = data.draw(st.integers(0, len(sound)))
    middle = data.draw(st.binary(max_size=20))
    skipped = data.draw(st.integers(0, 20))
    for content in (middle, sound[:place], sound[:place] + middle + sound[place + skipped :]):
        with contextlib.suppress(ServerError):
            codecs.unpack(content, dialect)


@given(
    st.recursive(
        st.none() | st.text("A1=", max_size=8) | st.integers() | st.binary(max_size=9),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(["__numpy__", "dtype", "shape", "x"]), inner, max_size=4)
        ),
        max_leaves=8,
    )
)
@settings(max_examples=40)
def test_any_json_gives_a_value_or_a_server_error(value: Any) -> None:
    with contextlib.suppress(ServerError):
        codecs.from_json(json.dumps(value, default=lambda data: data.hex()).encode())


def test_json_numpy_is_the_published_form() -> None:
    assert JSON_NUMPY.encode(np.array([1.0], dtype="<f4")) == {
        "__numpy__": "AACAPw==",
        "dtype": "<f4",
        "shape": [1],
    }


@pytest.mark.parametrize("part", [[], {}])
def test_a_message_of_too_many_parts_is_refused_before_all_are_made(
    part: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(codecs, "MOST_PARTS", 10)
    content = msgpack.packb([part] * 9)
    assert codecs.unpack(content, OPENPI) == [part] * 9
    with pytest.raises(ServerError, match="more than 10 lists"):
        codecs.unpack(msgpack.packb([part] * 11), OPENPI)


def test_extensions_and_json_of_too_many_parts_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for extension in (msgpack.ExtType(5, b""), msgpack.ExtType(5, b"a"), msgpack.Timestamp(0)):
        with pytest.raises(ServerError, match=r"extension of type|max_ext_len"):
            codecs.unpack(msgpack.packb([extension]), OPENPI)
    monkeypatch.setattr(codecs, "MOST_PARTS", 10)
    with pytest.raises(ServerError, match="more than 10 lists"):
        codecs.from_json(b"[" + b",".join([b"[]"] * 10) + b"]")


@pytest.mark.parametrize("several", [True, False], ids=["in several lists", "in one"])
def test_a_message_of_too_many_values_is_refused_before_all_are_made(
    several: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(codecs, "MOST_VALUES", 20)
    few, many = ([[1] * 5] * 3, [[1] * 5] * 4) if several else ([1] * 20, [1] * 21)
    assert codecs.unpack(msgpack.packb(few), OPENPI) == few
    assert codecs.from_json(json.dumps(few).encode()) == few
    with pytest.raises(ServerError, match=r"more than 20|max_array_len"):
        codecs.unpack(msgpack.packb(many), OPENPI)
    with pytest.raises(ServerError, match="more than 20 values"):
        codecs.from_json(json.dumps([many, 1, 2]).encode())


def test_a_map_of_too_many_entries_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codecs, "MOST_PARTS", 10)
    maps = [{"a": 1, "b": 2, "c": 3}] * 3
    with pytest.raises(ServerError, match="more than 10 lists"):
        codecs.unpack(msgpack.packb(maps), OPENPI)
    with pytest.raises(ServerError, match="more than 10 lists"):
        codecs.from_json(json.dumps(maps).encode())
