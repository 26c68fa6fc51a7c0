"""Calls of hooks that a ``conftest.py`` implements: they may raise anything."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pytest_libero_max.errors import class_name, text_of


def call_user_hook(
    hook: Callable[..., object], *, may_raise: tuple[type[BaseException], ...] = (), **arguments: Any
) -> str | None:
    """Call a hook; ``SystemExit`` in it is an exception like others, so that gates decide the status.

    Args:
        may_raise: Exceptions that are left to the caller, beside a keyboard interrupt.
        arguments: Of the hook.

    Returns:
        The exception that it raised, in words; None if it raised none.
    """
    passed_on: tuple[type[BaseException], ...] = (KeyboardInterrupt, *may_raise)
    try:
        hook(**arguments)
    except passed_on:
        raise
    except BaseException as error:  # a user's hook may raise anything, and must not cost the run
        return f"{class_name(error)}: {text_of(error)}"
    return None
