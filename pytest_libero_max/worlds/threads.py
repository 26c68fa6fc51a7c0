"""The linear algebra library (BLAS) of NumPy and SciPy: its threads and its kind of processor."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_VARIABLE = "OPENBLAS_NUM_THREADS"
_PACKAGES = ("numpy", "scipy")
# The wheels of NumPy and SciPy give the names of their own copies of OpenBLAS a prefix and a suffix.
_PREFIXES, _SUFFIXES = ("scipy_", ""), ("64_", "")


@dataclass(frozen=True)
class Blas:
    """A BLAS that is loaded into this process."""

    package: str
    """Package that it belongs to: ``numpy`` or ``scipy``, or the name of its file."""
    kind: str
    """The kind of processor whose instructions it uses, for example ``SkylakeX``. Its results differ in their
    last bits from kind to kind."""
    threads: int
    """Number of threads that it may use."""


def use_one_blas_thread() -> None:
    """Keep the BLAS of NumPy and SciPy to one thread, here and in processes started from here.

    The matrices of a control step have six or seven rows: more threads only wait for each other, and take
    the processors from the other workers (measured: twice the processor time for the same episodes). They
    also add up in another order, so that the last bits of a result would depend on their number.

    A number that the user has set in ``OPENBLAS_NUM_THREADS`` is kept. Otherwise a library that has been
    loaded already, for example by a ``conftest.py``, is set at once; one that is loaded later reads the
    variable.
    """
    if os.environ.setdefault(_VARIABLE, "1") == "1":
        for _, library in _loaded():
            _call(library, "set_num_threads", None, 1)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep the BLAS of NumPy and SciPy to one thread in the block, as :func:`use_one_blas_thread` does."""
    import numpy.linalg  # noqa: F401
    import scipy.linalg  # noqa: F401

    before, threads = os.environ.get(_VARIABLE), [(library, _threads(library)) for _, library in _loaded()]
    use_one_blas_thread()
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(_VARIABLE, None)
        for library, number in threads:
            _call(library, "set_num_threads", None, number)


def loaded_blas() -> tuple[Blas, ...]:
    """Return the OpenBLAS libraries of this process, by package; none where NumPy uses another library."""
    return tuple(
        Blas(
            package,
            _call(library, "get_corename", ctypes.c_char_p).decode(),
            _threads(library),
        )
        for package, library in _loaded()
    )


def fingerprint() -> dict[str, str]:
    """Processor kind and threads of the BLAS, for the record: the last bits of a result depend on both.

    It imports NumPy and SciPy, so that it says the same whatever has been imported before.
    """
    import numpy.linalg  # noqa: F401
    import scipy.linalg  # noqa: F401

    libraries = loaded_blas()
    if not libraries:
        return {"blas": "not OpenBLAS"}
    kinds = sorted({blas.kind for blas in libraries})
    threads = sorted({blas.threads for blas in libraries})
    return {"blas": "/".join(kinds), "blas_threads": "/".join(map(str, threads))}


def _loaded() -> Iterator[tuple[str, ctypes.CDLL]]:
    for path in _files():
        package = next((name for name in _PACKAGES if f"{name}." in path.parent.name), path.name)
        library = ctypes.CDLL(str(path))
        if _function(library, "set_num_threads") is not None:
            yield package, library


def _threads(library: ctypes.CDLL) -> int:
    return int(_call(library, "get_num_threads", ctypes.c_int))


def _files() -> list[Path]:
    """Return the files of the OpenBLAS libraries that are loaded, sorted."""
    maps = Path("/proc/self/maps")
    if maps.exists():
        mapped = {line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines() if "/" in line}
    else:
        mapped = {str(path) for name in _PACKAGES if name in sys.modules for path in _bundled(name)}
    return sorted(Path(path) for path in mapped if "openblas" in Path(path).name.lower())


def _bundled(package: str) -> Iterator[Path]:
    """Libraries that came with a package's wheel; loading one again gives the one that is loaded."""
    spec = importlib.util.find_spec(package)
    for location in (spec.submodule_search_locations or []) if spec else []:
        for folder in (Path(location).parent / f"{package}.libs", Path(location) / ".dylibs"):
            yield from folder.glob("*openblas*")


def _function(library: ctypes.CDLL, name: str) -> Any:
    for prefix in _PREFIXES:
        for suffix in _SUFFIXES:
            try:
                return getattr(library, f"{prefix}openblas_{name}{suffix}")
            except AttributeError:
                continue
    return None


def _call(library: ctypes.CDLL, name: str, returns: Any, *arguments: int) -> Any:
    function = _function(library, name)
    function.restype = returns
    return function(*arguments)
