"""Sessions that pytester starts, and their workers, play short episodes."""

from __future__ import annotations

from types import MappingProxyType

import pytest

from pytest_libero_max.benchmark import cases

PLUGIN = """
from pytest_libero_max.benchmark import cases

cases.SUITE_BUDGETS = dict.fromkeys(cases.SUITE_BUDGETS, {steps})
"""


def short_episodes(pytester: pytest.Pytester, steps: int) -> tuple[str, ...]:
    """Write a plugin that gives every suite a budget of ``steps``.

    Returns:
        The arguments that load it, and leave out plugins that take a session longer than its pairs: the
        summary of Hypothesis imports all of it, and at its end pytest collects garbage five times.
    """
    pytester.makepyfile(short_episodes=PLUGIN.format(steps=steps))
    left_out = ("hypothesispytest", "anyio", "unraisableexception")
    return ("--assert=plain", "-p", "short_episodes", *(word for name in left_out for word in ("-p", f"no:{name}")))


def shorten_here(monkeypatch: pytest.MonkeyPatch, steps: int) -> None:
    """Give every suite a budget of ``steps`` in this process."""
    budgets = MappingProxyType(dict.fromkeys(cases.SUITE_BUDGETS, steps))
    monkeypatch.setattr(cases, "SUITE_BUDGETS", budgets)
