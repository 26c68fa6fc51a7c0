"""Calls of hooks that a ``conftest.py`` implements: they may raise anything, or try to end the process."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from pytest_libero_max.errors import class_name, text_of

_ENDS = ("_exit", "execv", "execve")
"""Functions of :mod:`os` that end a Python process with a status that nobody has decided."""


def call_user_hook(
    hook: Callable[..., object], *, may_raise: tuple[type[BaseException], ...] = (), **arguments: Any
) -> str | None:
    """Call a hook. What would end the process is an exception in it, so that gates decide the status.

    Args:
        hook: The hook.
        may_raise: Exceptions that are left to the caller, beside a keyboard interrupt.
        arguments: Of the hook.

    Returns:
        The exception that it raised, in words; None if it raised none.
    """
    passed_on: tuple[type[BaseException], ...] = (KeyboardInterrupt, *may_raise)
    try:
        with _process_kept():
            hook(**arguments)
    except passed_on:
        raise
    except BaseException as error:  # a user's hook may raise anything, and must not cost the run
        return f"{class_name(error)}: {text_of(error)}"
    return None


@contextmanager
def _process_kept() -> Iterator[None]:
    session, ends = os.getpid(), {name: getattr(os, name) for name in _ENDS}

    def instead_of(name: str) -> Callable[..., NoReturn]:
        def raising(*arguments: Any) -> NoReturn:
            if os.getpid() != session:  # a child that the hook has started
                ends[name](*arguments)
            raise SystemExit(f"os.{name} would end the run in the middle, and was not called")

        return raising

    for name in _ENDS:
        setattr(os, name, instead_of(name))
    try:
        yield
    finally:
        for name, end in ends.items():
            setattr(os, name, end)
