"""Blocks of settings on the same cases: the best one."""

from __future__ import annotations

from pytest_libero_max.stats.blocks import Block, Count, Difference, Share, Text


class SettingDifference(Block, frozen=True, kw_only=True):
    """Success of the best setting less that of another."""

    value: Difference | None
    """Success of the best less that of the other."""
    lower: Difference | None
    """Lower end of its exact interval, which holds together with those of all pairs of settings with 95%."""
    upper: Difference | None
    """Upper end of the same."""


class BestSetting(Block, frozen=True, kw_only=True):
    """The best setting, with intervals that account for the choice."""

    setting: Text
    """Label of the setting of the highest rate, the first among equals."""
    count: Count
    """Its cases that succeed."""
    of: Count
    """Cases: the denominator."""
    value: Share | None
    """Its success rate."""
    lower: Share | None
    """Lower end of its interval, which holds together with those of all settings with 95% (exact,
    Bonferroni)."""
    upper: Share | None
    """Upper end of the same."""
    not_worse: list[str]
    """Other settings that the cases do not show to be worse."""
    differences: dict[str, SettingDifference]
    """From each other setting."""
