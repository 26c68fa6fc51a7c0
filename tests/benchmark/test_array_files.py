from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pytest_libero_max.benchmark import array_files
from pytest_libero_max.benchmark.array_files import array_of, read_arrays


def npy(array: Any) -> bytes:
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()


@pytest.mark.parametrize(
    "array",
    [
        np.linspace(0, 1, 12).reshape(3, 4),
        np.asfortranarray(np.arange(6, dtype=np.float32).reshape(2, 3)),
        np.array("some text"),
        np.array(7),
        np.zeros((0, 7)),
        np.array([True, False]),
        np.array([[1, 2]], dtype=">u2"),
    ],
)
def test_arrays_are_read_as_numpy_reads_them(tmp_path: Path, array: Any) -> None:
    np.savez_compressed(tmp_path / "a.npz", one=array, two=np.eye(2))
    arrays = read_arrays(tmp_path / "a.npz")
    assert arrays.keys() == {"one", "two"}
    assert (arrays["one"].dtype, arrays["one"].shape) == (array.dtype, array.shape)
    assert np.array_equal(arrays["one"], array)
    assert arrays["one"].flags.writeable
    assert arrays["one"].flags.f_contiguous == array.flags.f_contiguous


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"PK",
        npy(np.eye(3))[:-1],
        npy(np.eye(3)).replace(b"(3, 3)", b"(9**9,"),
        npy(np.eye(3)).replace(b"(3, 3)", b"(3,-3)"),
        npy(np.eye(3)).replace(b"(3, 3), }", b"(('(3, 3'"),
        npy(np.eye(100)).replace(b"(100, 100)", b"(99999999,)"),
        npy(np.array([object()], dtype=object)),
    ],
)
def test_whatever_is_damaged_is_a_value_error(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"^it holds "):
        array_of(content)


def test_an_archive_that_is_damaged_or_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("one.npy", npy(np.arange(300.0)))
    sound = path.read_bytes()
    for place in (60, 200, 400):
        path.write_bytes(sound[:place] + bytes(9) + sound[place + 9 :])
        with pytest.raises(ValueError, match=r"^it "):
            read_arrays(path)
    path.write_bytes(sound)
    monkeypatch.setattr(array_files, "MOST_BYTES", 2000)
    with pytest.raises(ValueError, match="more than 2000 bytes"):
        read_arrays(path)
