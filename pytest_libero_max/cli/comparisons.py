"""Ways of ``libero-max compare`` that installed packages add, each under the name of its option.

An entry point of the group ``pytest_libero_max.comparisons`` names a module::

    [project.entry-points."pytest_libero_max.comparisons"]
    over-time = "my_package.over_time"

Its function ``add_options`` adds ``--over-time``, and options that belong to it and that ``OPTIONS`` names.
Its function ``compare`` compares the runs when the option is given, and returns True where the comparison
without it has to follow. ``TAKES`` names the options of ``compare`` itself that it reads.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from pytest_libero_max.errors import OptionError
from pytest_libero_max.registry import Registry

OF_COMPARE = ("restrict", "json", "output")
"""Options of the command itself that a way of comparing may leave unread."""


class Comparison(NamedTuple):
    """A way to compare runs."""

    add_options: Callable[[argparse.ArgumentParser], object]
    compare: Callable[[argparse.Namespace], bool]
    options: Sequence[str]
    takes: Sequence[str]
    """Those of :data:`OF_COMPARE` that it reads."""


def _accept(_: str, module: Any) -> Comparison:
    add_options: Any = getattr(module, "add_options", None)
    compare: Any = getattr(module, "compare", None)
    if not (callable(add_options) and callable(compare)):
        raise ValueError("an entry point is a module with functions add_options and compare")
    return Comparison(add_options, compare, getattr(module, "OPTIONS", ()), getattr(module, "TAKES", ()))


COMPARISONS: Registry[Comparison] = Registry(
    "comparison", "pytest_libero_max.comparisons", dict, _accept, OptionError
)
"""The ways that are installed, by the name of their option."""


def asked_comparison(options: argparse.Namespace) -> Comparison | None:
    """Return the way that the options ask for; None for the usual one; raises OptionError."""
    names = [name for name in COMPARISONS if _is_given(options, name)]
    for name, way in COMPARISONS.items():
        for option in way.options:
            if name not in names and _is_given(options, option):
                raise OptionError(f"--{option} belongs to --{name}. Give --{name} as well.")
    if not names:
        return None
    if len(names) > 1:
        raise OptionError(f"--{names[0]} and --{names[1]} compare in different ways. Give one of them.")
    (name,) = names
    way = COMPARISONS[name]
    if unread := [
        *_flags(option for option in OF_COMPARE if option not in way.takes and _is_given(options, option))
    ]:
        raise OptionError(
            f"--{name} was given with {', '.join(unread)}, but it takes "
            f"{', '.join(_flags((*way.takes, *way.options))) or 'no further option'}."
        )
    return way


def _is_given(options: argparse.Namespace, name: str) -> bool:
    return getattr(options, name.replace("-", "_")) not in (None, False)


def _flags(names: Any) -> Iterator[str]:
    return (f"--{name}" for name in names)
