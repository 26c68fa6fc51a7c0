"""Blocks of conditions on the same cases: rates, contrasts and the best one."""

from __future__ import annotations

from pytest_libero_max.stats.blocks import (
    Block,
    Bootstrap,
    Count,
    Difference,
    Rate,
    Share,
    Text,
    WideDifference,
)


class Mean(Block, frozen=True, kw_only=True):
    """A mean difference over cases.

    Attributes:
        value: Mean over the cases; None without cases.
        lower: Lower end of the 95% interval for independent cases: the melded exact one, and for a difference
            of differences that of weighted means (Gaffke 2005).
        upper: Upper end of the same.
        bootstrap: The paper's interval, percentiles of the exact bootstrap distribution with the number of
            cases of each source kept, for comparison with it; far too narrow where few cases differ.
    """

    value: WideDifference | None
    lower: WideDifference | None
    upper: WideDifference | None
    bootstrap: Bootstrap


class SourceRate(Rate, frozen=True, kw_only=True):
    """Success in one condition of a camera study, of the cases of a source.

    Attributes:
        count: Cases that succeed.
        of: Cases: the denominator.
        bootstrap: The paper's interval, percentiles of the exact bootstrap distribution, for comparison with
            it; far too narrow where few cases succeed, or few fail.
    """

    bootstrap: Bootstrap


class ConditionRate(SourceRate, frozen=True, kw_only=True):
    """Success in one condition of a camera study.

    Attributes:
        by_source: The same within each source.
    """

    by_source: dict[str, SourceRate]


class GroupInterval(Block, frozen=True, kw_only=True):
    """An interval that resamples groups of cases.

    Attributes:
        groups: Groups of cases that are resampled whole.
        changed: Groups in which a case differs.
        replicates: Resamples.
        lower: Lower end of the 95% interval; None where too few groups changed to decide.
        upper: Upper end of the same.
    """

    groups: Count
    changed: Count
    replicates: Count
    lower: WideDifference | None
    upper: WideDifference | None


class ConditionContrast(Mean, frozen=True, kw_only=True):
    """Mean of the first condition less the second, over the same cases. Pointwise: nothing is corrected for.

    Attributes:
        first: Arm, or strength in a contrast between strengths, that is subtracted from.
        second: Arm or strength that is subtracted.
        gains: Cases in which the difference is above 0: only the first succeeds.
        losses: Cases in which the difference is below 0: only the second succeeds.
        by_source: The mean and its intervals within each source.
        by_groups: Intervals over groups of cases: reference_tasks jointly across the sources, source_tasks
            and configurations within each source.
    """

    first: Text
    second: Text
    gains: Count
    losses: Count
    by_source: dict[str, Mean]
    by_groups: dict[str, GroupInterval]


class SettingDifference(Block, frozen=True, kw_only=True):
    """Success of the best setting less that of another.

    Attributes:
        value: Success of the best less that of the other.
        lower: Lower end of its exact interval, which holds together with those of all pairs of settings with
            95%.
        upper: Upper end of the same.
    """

    value: Difference | None
    lower: Difference | None
    upper: Difference | None


class BestSetting(Block, frozen=True, kw_only=True):
    """The best setting, with intervals that account for the choice.

    Attributes:
        setting: Label of the setting of the highest rate, the first among equals.
        count: Its cases that succeed.
        of: Cases: the denominator.
        value: Its success rate.
        lower: Lower end of its interval, which holds together with those of all settings with 95% (exact,
            Bonferroni).
        upper: Upper end of the same.
        not_worse: Other settings that the cases do not show to be worse.
        differences: From each other setting.
    """

    setting: Text
    count: Count
    of: Count
    value: Share | None
    lower: Share | None
    upper: Share | None
    not_worse: list[str]
    differences: dict[str, SettingDifference]
