"""Compilation by Numba, kept on disk between processes where that is possible."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

from pytest_libero_max.machine import named_user_cache


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that Numba compiles at its first call and keeps on disk, where a folder is writable.

    The folder is ``NUMBA_CACHE_DIR``, else that of the function's module, else the user's cache
    (:func:`~pytest_libero_max.machine.user_cache`).
    """
    try:
        with named_user_cache():
            return numba.njit(cache=True)(function)  # type: ignore[no-any-return]
    except RuntimeError:  # no folder: each process compiles for itself
        return numba.njit(function)  # type: ignore[no-any-return]


def kept_in() -> str | None:
    """Return the folder in which loops of this package are kept; None where no folder is writable."""

    def nothing() -> None: ...

    return compiled(nothing).stats.cache_path  # type: ignore[attr-defined,no-any-return]
