"""The results of a camera study, as ``report.json`` stores them."""

from __future__ import annotations

from pytest_libero_max.stats.blocks import Block, Bootstrap, Count, Rate, Text, WideDifference


class Mean(Block, frozen=True, kw_only=True):
    """A mean difference over cases."""

    value: WideDifference | None
    """Mean over the cases; None without cases."""
    lower: WideDifference | None
    """Lower end of the 95% interval for independent cases: the melded exact one, and for a difference of
    differences that of weighted means (Gaffke 2005)."""
    upper: WideDifference | None
    """Upper end of the same."""
    bootstrap: Bootstrap
    """The paper's interval, percentiles of the exact bootstrap distribution with the number of cases of each
    source kept, for comparison with it; far too narrow where few cases differ."""


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
    """Success in one condition of a camera study."""

    by_source: dict[str, SourceRate]
    """The same within each source."""


class GroupInterval(Block, frozen=True, kw_only=True, omit_defaults=True):
    """An interval that resamples groups of cases."""

    groups: Count
    """Groups of cases that are resampled whole."""
    changed: Count
    """Groups in which a case differs."""
    replicates: Count
    """Resamples."""
    lower: WideDifference | None
    """Lower end of the 95% interval; None where too few groups changed to decide."""
    upper: WideDifference | None
    """Upper end of the same."""
    withheld: bool = False
    """True if a rule stopped the run, so that it has no intervals."""


class ConditionContrast(Mean, frozen=True, kw_only=True):
    """Mean of the first condition less the second, over the same cases. Pointwise: without correction."""

    first: Text
    """Arm, or strength in a contrast between strengths, that is subtracted from."""
    second: Text
    """Arm or strength that is subtracted."""
    gains: Count
    """Cases in which the difference is above 0: only the first succeeds."""
    losses: Count
    """Cases in which the difference is below 0: only the second succeeds."""
    by_source: dict[str, Mean]
    """The mean and its intervals within each source."""
    by_groups: dict[str, GroupInterval]
    """Intervals over groups of cases: reference_tasks jointly across the sources, source_tasks and
    configurations within each source."""


class JointOutcome(Block, frozen=True, kw_only=True):
    """Cases that ended alike in all arms."""

    success: dict[str, bool]
    """Success of each arm."""
    cases: Count
    """Cases that ended so."""


class Camera(Block, frozen=True, kw_only=True):
    """Results of a camera study."""

    conditions: dict[str, str]
    """Name of each arm in tables. Mid-task is the arm dynamic."""
    rates: dict[str, ConditionRate]
    """Success by arm."""
    outcomes: list[JointOutcome]
    """Endings of cases in all arms together, the frequent ones first."""
    contrasts: list[ConditionContrast]
    """Within each strength, and of each timing between strengths."""
    gap_contrasts: list[ConditionContrast]
    """Mid-task less Reset at one strength, less the same at another."""
    approach: dict[str, dict[str, Count]]
    """Numbers of cases by strength and by what they have in common: the approach of the hand in Reset, and
    queries after the event of Mid-task."""
