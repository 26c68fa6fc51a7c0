"""A worker's connection to its controller, which is the worker's alone."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import pytest


def keep_from_children(config: pytest.Config) -> None:
    """Let no process that this worker forks hold the connection open.

    An adapter may fork helpers. The connection of a worker that is killed would stay open as long as one of
    them lives, and the controller would wait for the worker instead of replacing it.
    """
    descriptors = [number for plugin in config.pluginmanager.get_plugins() for number in _descriptors(plugin)]
    close_in_children(descriptors)


def close_in_children(descriptors: Sequence[int]) -> None:
    """Let no process that this one forks have these files."""
    os.register_at_fork(after_in_child=lambda: _close(descriptors))


def _descriptors(plugin: Any) -> list[int]:
    """Of the connection, where this is the plugin of xdist that has it."""
    gateway = getattr(getattr(plugin, "channel", None), "gateway", None)
    files = (getattr(getattr(gateway, "_io", None), name, None) for name in ("infile", "outfile"))
    return [file.fileno() for file in files if file is not None]


def _close(descriptors: Sequence[int]) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    for descriptor in descriptors:
        os.dup2(nowhere, descriptor, inheritable=False)  # the number stays taken: a file object has it
    os.close(nowhere)
