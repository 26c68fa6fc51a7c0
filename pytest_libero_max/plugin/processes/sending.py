"""What workers send to the controller, as values that every transport knows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

_AS_THEY_ARE: tuple[type, ...] = (type(None), bool, int, float, complex, bytes)
"""Types that execnet sends by themselves; it refuses each subclass of them, such as NumPy's ``float64``."""

_LEAST_INTEGER = -(2**31)
"""Execnet sends an integer of any size above this one, and ends the session at a smaller one."""


def sendable(value: Any) -> Any:
    """Return a value for another process, in which text can be encoded and all types are Python's own.

    A transport refuses one character that is half of a pair, as in the name of a file that is no UTF-8, and
    with it the report, the session and all pairs that the worker has played. Such characters are spelled
    (``\\udce9``), subclasses become their base, and what no transport knows becomes its ``repr``.
    """
    if isinstance(value, str):
        return encodable(str.__str__(value))
    if type(value) is int and value < _LEAST_INTEGER:
        return str(value)
    if type(value) in _AS_THEY_ARE:
        return value
    if isinstance(value, dict):
        return {sendable(key): sendable(entry) for key, entry in value.items()}
    for kind in (list, tuple, set, frozenset):
        if isinstance(value, kind):
            return kind(map(sendable, value))
    base = next((kind for kind in _AS_THEY_ARE if isinstance(value, kind)), None)
    return encodable(repr(value)) if base is None else base(value)


def encodable(text: str) -> str:
    """Return text in which what UTF-8 cannot hold is spelled, for example ``\\udce9``."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return text.encode(errors="backslashreplace").decode()
    return text


def send_only_sendable(config: pytest.Config) -> None:
    """Let the plugin of xdist that is this worker's way to the controller send nothing else.

    All that a worker sends goes through its ``sendevent``: reports, warnings, ids, internal errors, and what
    other plugins leave for the controller.
    """
    for plugin in config.pluginmanager.get_plugins():
        if hasattr(plugin, "sendevent") and hasattr(plugin, "channel"):
            plugin.sendevent = _sending(plugin.sendevent)


def _sending(send: Callable[..., None]) -> Callable[..., None]:
    def sendevent(name: str, **kwargs: object) -> None:
        send(name, **sendable(kwargs))

    return sendevent
