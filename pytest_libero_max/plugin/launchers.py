"""Launchers: what plays the pairs of a session on other machines, in the place of xdist and of this process.

An entry point of the group ``pytest_libero_max.launchers`` has the name of the option that asks for it,
``ray`` for ``--libero-max-ray``, and names what makes a plugin of pytest from the controller of the session.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry

if TYPE_CHECKING:
    from pytest_libero_max.plugin.controller import RunController

Launcher: TypeAlias = "Callable[[RunController], object]"
"""Returns a plugin whose ``pytest_runtestloop`` plays the pairs and reports them as those of this process."""


def _accept(_: str, make: Any) -> Launcher:
    if not callable(make):
        raise ValueError("an entry point of a launcher is a class or function that makes a plugin of pytest")
    launcher: Launcher = make
    return launcher


LAUNCHERS: Registry[Launcher] = Registry(
    "launcher", "pytest_libero_max.launchers", dict, _accept, OptionError
)
"""The launchers that are installed, by the name of their option."""
