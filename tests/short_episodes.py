"""Sessions that pytester starts, and their workers, play short episodes."""

from __future__ import annotations

import pytest

from pytest_libero_max.benchmark import cases

PLUGIN = """
from pytest_libero_max.benchmark import cases

cases.step_budget = lambda suite: {steps}
"""


def short_episodes(pytester: pytest.Pytester, steps: int) -> tuple[str, ...]:
    """Write a plugin that gives every suite a budget of ``steps``.

    Returns:
        The arguments that load it, and leave out what takes a session longer than its pairs: no assert is
        rewritten; Hypothesis would be imported for its summary, and garbage be collected five times.
    """
    pytester.makepyfile(short_episodes=PLUGIN.format(steps=steps))
    left_out = ("hypothesispytest", "anyio", "unraisableexception")
    words = (word for name in left_out for word in ("-p", f"no:{name}"))
    return ("--assert=plain", "-p", "short_episodes", *words)


def shorten_here(monkeypatch: pytest.MonkeyPatch, steps: int) -> None:
    """Give every suite a budget of ``steps`` in this process."""
    monkeypatch.setattr(cases, "step_budget", lambda suite: steps)
