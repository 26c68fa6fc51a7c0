"""Arrays in files of NumPy's: nothing is unpickled, and no file unpacks without bounds."""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pytest_libero_max.benchmark.documents import MOST_BYTES


def read_members(path: Path, wanted: tuple[str, ...] | None = None) -> dict[str, bytes]:
    """Return the unpacked members of a zip archive by name.

    Args:
        wanted: Endings of the names that are read; None for all.
    """
    content = path.read_bytes()
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [
                item for item in archive.infolist() if wanted is None or item.filename.endswith(wanted)
            ]
            if sum(item.file_size for item in members) > MOST_BYTES:
                raise ValueError(f"it unpacks to more than {MOST_BYTES} bytes")
            return {item.filename: archive.read(item) for item in members}
    except Exception as error:  # its own errors, those of zlib, and others for what it cannot read
        raise ValueError(f"it is no sound archive ({type(error).__name__}: {error})") from error


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of an ``.npz`` file by name, or raise OSError or ValueError."""
    members = read_members(path)
    return {name.removesuffix(".npy"): array_of(content) for name, content in members.items()}


def array_of(content: bytes) -> NDArray[Any]:
    """Return the array of the content of an ``.npy`` file, or raise ValueError."""
    file = io.BytesIO(content)
    try:
        # Not numpy.load, which reserves memory for the size that the header claims before it reads.
        version = np.lib.format.read_magic(file)
        read = (
            np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        )
        shape, fortran, dtype = read(file)
    except Exception as error:  # the header is an expression of Python, and so are the errors
        raise ValueError(f"it holds no NumPy array ({type(error).__name__}: {error})") from error
    size = len(content) - file.tell()
    if dtype.hasobject or not dtype.itemsize or dtype.itemsize * math.prod(shape) != size:
        raise ValueError(f"it holds {size} bytes as an array of {dtype} with shape {shape}")
    array = np.frombuffer(content, dtype, offset=file.tell())
    return array.reshape(shape, order="F" if fortran else "C").copy(order="K")
