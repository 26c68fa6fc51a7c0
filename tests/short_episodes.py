"""Sessions that pytester starts, and their workers, play short episodes."""

from __future__ import annotations

import pytest

PLUGIN = """
from pytest_libero_max.benchmark.cases import SUITE_BUDGETS

SUITE_BUDGETS.update(dict.fromkeys(SUITE_BUDGETS, {steps}))
"""


def short_episodes(pytester: pytest.Pytester, steps: int) -> tuple[str, ...]:
    """Write a plugin that gives every suite a budget of ``steps``.

    Returns:
        The arguments that load it.
    """
    pytester.makepyfile(short_episodes=PLUGIN.format(steps=steps))
    return ("-p", "short_episodes")
