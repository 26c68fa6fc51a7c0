"""Reading LIBERO's initial states: without torch, and without executing pickles.

A ``.pruned_init`` file is what ``torch.save`` makes of a NumPy array: a zip archive with one pickle in it.
That pickle needs four names to rebuild an array of numbers; any other is refused. ``.npz`` and ``.npy`` files
are NumPy's own.
"""

from __future__ import annotations

import codecs
import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pytest_libero_max.benchmark.array_files import array_of, read_arrays, read_members
from pytest_libero_max.errors import SubstrateError, counted
from pytest_libero_max.worlds.contract import Array


def read_states(path: Path) -> Array:
    """Return the initial states in a file, (n, 1 + nq + nv) float64: time, joint positions, velocities.

    Args:
        path: A ``.pruned_init``, ``.init``, ``.npz`` or ``.npy`` file. A single state counts as one row. An
            ``.npz`` file has them in the array ``states``.

    Raises:
        SubstrateError: The file is missing, is something else, or holds more than an array of numbers.
    """
    try:
        if path.suffix == ".npy":
            raw = array_of(path.read_bytes())
        elif path.suffix == ".npz":
            raw = read_arrays(path)["states"]
        else:
            raw = _Arrays(io.BytesIO(_pickle_of(path))).load()
    except OSError as error:
        raise SubstrateError(f"Cannot read the initial states {str(path)!r}: {error}.") from error
    except Exception as error:  # a damaged pickle is a program for a machine, which may fail in any way
        raise SubstrateError(
            f"{str(path)!r} is no file of initial states: {error}. Restore it from the package."
        ) from error
    states = np.atleast_2d(np.asarray(raw))
    if states.ndim != 2 or states.dtype.kind != "f" or not np.isfinite(states).all():
        raise SubstrateError(
            f"{str(path)!r} holds {states.dtype} of shape {states.shape}, but initial states are finite "
            "numbers, one row a state. Restore it from the package."
        )
    return np.ascontiguousarray(states, dtype=np.float64)


def _pickle_of(path: Path) -> bytes:
    pickles = read_members(path, ("/data.pkl",))
    if len(pickles) != 1:
        raise ValueError(f"it has {counted(len(pickles), 'pickle')}, but one is expected")
    return next(iter(pickles.values()))


def _empty(kind: type, shape: Any, code: Any) -> np.ndarray[Any, Any]:
    if kind is not np.ndarray:
        raise ValueError(f"it rebuilds a {kind!r}, not an array")
    return np.ndarray.__new__(np.ndarray, (0,), np.uint8)


def _encode(text: str, encoding: str = "latin1") -> bytes:
    return codecs.encode(text, "latin1") if encoding == "latin1" else codecs.encode(text, "ascii")


def _dtype(code: str, align: bool = False, copy: bool = True) -> np.dtype[Any]:
    if code not in ("f8", "f4"):
        raise ValueError(f"it holds values of type {code!r}, not floating-point numbers")
    return np.dtype(code)


class _Arrays(pickle._Unpickler):
    """Rebuilds an array of numbers and nothing else.

    The one written in Python: that in C makes room for as many remembered objects as a pickle says, and some
    bytes of damage would take all memory.
    """

    _NAMES: ClassVar[dict[tuple[str, str], Callable[..., Any] | type]] = {
        ("numpy.core.multiarray", "_reconstruct"): _empty,
        ("numpy._core.multiarray", "_reconstruct"): _empty,
        ("numpy", "ndarray"): np.ndarray,
        ("numpy", "dtype"): _dtype,
        ("_codecs", "encode"): _encode,
    }

    def find_class(self, module: str, name: str) -> Any:
        try:
            return self._NAMES[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"it asks for {module}.{name}, which no array needs") from None

    def persistent_load(self, pid: Any) -> Any:
        raise pickle.UnpicklingError("it holds a torch tensor, but LIBERO's states are NumPy arrays")
