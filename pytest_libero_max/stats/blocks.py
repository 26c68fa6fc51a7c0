"""Blocks of reports: rates, changes, intervals and contrasts, which statistics return and documents hold.

The schemas of ``report.json`` and ``comparison.json`` are made from these classes and their docstrings.
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct, field, structs

from pytest_libero_max.benchmark.structs import LARGEST
from pytest_libero_max.stats import ratios

Count = Annotated[int, Meta(ge=0, le=LARGEST)]
Positive = Annotated[int, Meta(ge=1, le=LARGEST)]
Text = Annotated[str, Meta(min_length=1)]
Share = Annotated[float, Meta(ge=0, le=1)]
Difference = Annotated[float, Meta(ge=-1, le=1)]
WideDifference = Annotated[float, Meta(ge=-2, le=2)]
Log10 = Annotated[float, Meta(le=0)]
Amount = Annotated[float, Meta(ge=0)]


class Block(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A JSON object of a report: exactly these fields, in this order."""


class Ratio(Block, frozen=True, kw_only=True):
    """A ratio with its counts.

    Attributes:
        count: Numerator; negative for a loss.
        of: Denominator.
        value: count / of; None where the denominator is zero.
    """

    count: int
    of: Count
    value: float | None


class Rate(Block, frozen=True, kw_only=True):
    """A rate with its counts and 95% interval; None where the denominator is zero.

    Attributes:
        count: Pairs that have the property.
        of: Pairs that were asked: the denominator.
        value: count / of, 0 to 1; None where the denominator is zero.
        lower: Lower end of the exact 95% interval (Clopper and Pearson); None where a rule stopped the run.
        upper: Upper end of the exact 95% interval (Clopper and Pearson); None where a rule stopped the run.
    """

    count: Count
    of: Count
    value: Share | None
    lower: Share | None
    upper: Share | None


class Interval(Block, frozen=True, kw_only=True):
    """A 95% interval.

    Attributes:
        lower: Lower end; None where there is none.
        upper: Upper end; None where there is none.
    """

    lower: WideDifference | None
    upper: WideDifference | None


class IntervalByTask(Block, frozen=True, kw_only=True):
    """A 95% interval for statements about other tasks: tasks are resampled with all their pairs.

    Attributes:
        tasks: Tasks that the pairs are of.
        effective_tasks: (sum of n)^2 / (sum of n^2) over the numbers of pairs of the tasks.
        changed_tasks: Tasks in which a pair changed; between runs, with a case that tells them apart; for a
            rate, the smaller of the tasks with a success and those with a failure.
        lower: Lower end; None where too few tasks changed to decide.
        upper: Upper end; None where too few tasks changed to decide.
    """

    tasks: Count
    effective_tasks: Amount
    changed_tasks: Count
    lower: WideDifference | None
    upper: WideDifference | None


class TaskInterval(IntervalByTask, frozen=True, kw_only=True):
    """A 95% interval for statements about other tasks, with the estimate.

    Attributes:
        value: The estimate over all pairs.
    """

    value: WideDifference | None


class RatesByTask(Block, frozen=True, kw_only=True):
    """Rates with their intervals for statements about other tasks.

    Attributes:
        base_success: Base success rate.
        dynamic_success: Dynamic success rate.
        conditional_regression: Share of Base successes lost.
    """

    base_success: TaskInterval
    dynamic_success: TaskInterval
    conditional_regression: TaskInterval


class Bootstrap(Block, frozen=True, kw_only=True):
    """The paper's percentile bootstrap.

    Attributes:
        lower: Lower end of the 95% interval.
        upper: Upper end of the 95% interval.
        degenerate: True if all differences are equal, so that the interval has no width and says nothing
            about precision.
    """

    lower: WideDifference | None
    upper: WideDifference | None
    degenerate: bool | None


class Bootstraps(Bootstrap, frozen=True, kw_only=True):
    """The paper's percentile bootstrap over all pairs alike, and with the sources kept.

    Attributes:
        by_source: The same with the number of pairs of each source kept.
    """

    by_source: Bootstrap


class MeanDifference(Block, frozen=True, kw_only=True):
    """A mean of paired differences of success with its interval.

    Attributes:
        count: Pairs in which only the one succeeds, less those in which only the other does.
        of: Pairs: the denominator.
        value: count / of, -1 to 1.
        lower: Lower end of the melded exact 95% interval, which takes all pairs as independent; None where a
            rule stopped the run.
        upper: Upper end of the melded exact 95% interval; None where a rule stopped the run.
    """

    count: int
    of: Count
    value: Difference | None
    lower: Difference | None
    upper: Difference | None


class Change(MeanDifference, frozen=True, kw_only=True):
    """A paired change with its intervals.

    Attributes:
        count: Gains minus regressions.
        of: Played pairs.
        value: Paired change, the mean of Dynamic less Base: count / of, -1 to 1; negative for a loss.
        by_task: 95% interval for statements about other tasks: tasks are resampled with all their pairs.
        bootstrap: The paper's percentile bootstrap, for comparison with it; too narrow with few changed
            pairs.
    """

    by_task: TaskInterval
    bootstrap: Bootstraps


class Outcomes(Block, frozen=True):
    """Pairs by outcome, written (Base, Dynamic).

    Attributes:
        preserved_success: Pairs that succeed in Base and in Dynamic, (1,1).
        change_associated_success: Pairs that fail in Base and succeed in Dynamic, (0,1).
        regression: Pairs that succeed in Base and fail in Dynamic, (1,0).
        persistent_failure: Pairs that fail in both, (0,0).
    """

    preserved_success: Count
    change_associated_success: Count
    regression: Count
    persistent_failure: Count

    @property
    def total(self) -> int:
        return sum(structs.astuple(self))

    @property
    def base(self) -> ratios.Ratio:
        """Base success rate over all pairs."""
        return ratios.Ratio(self.preserved_success + self.regression, self.total)

    @property
    def dynamic(self) -> ratios.Ratio:
        """Dynamic success rate over all pairs."""
        return ratios.Ratio(self.preserved_success + self.change_associated_success, self.total)

    @property
    def change(self) -> ratios.Ratio:
        """Paired change, the mean of (Dynamic - Base): (gained - regressed) / N. Negative for a loss."""
        return ratios.Ratio(self.change_associated_success - self.regression, self.total)

    @property
    def conditional_regression(self) -> ratios.Ratio:
        """Share of the Base successes that fail in Dynamic."""
        return ratios.Ratio(self.regression, self.base.count)

    @property
    def retained(self) -> ratios.Ratio:
        """Dynamic successes over Base successes, newly solved cases included; may exceed 1."""
        return ratios.Ratio(self.dynamic.count, self.base.count)


class McNemar(Block, frozen=True, kw_only=True):
    """Exact two-sided McNemar test of regressions against gains.

    Attributes:
        regressions: Pairs (1,0).
        gains: Pairs (0,1).
        p_value: 0 where below the smallest double; the logarithm stays exact.
        log10_p_value: Decimal logarithm of the p-value; None without a pair (1,0) or (0,1), and where a rule
            stopped the run.
    """

    regressions: Count
    gains: Count
    p_value: Share | None
    log10_p_value: Log10 | None


class StaleActions(Block, frozen=True, kw_only=True):
    """Queued actions executed between the event and the next query.

    Attributes:
        pairs: Pairs in which a query followed the event.
        unanswered: Pairs whose episode ended between the event and the next query; not counted in the numbers
            below.
        mean: Mean number of actions executed between the event and the next query; None without a pair.
        median: Median of the same; the mean of the middle two for an even number of pairs.
        quantiles: Quantiles of the same by probability (0.05, 0.25, 0.75, 0.95), by inverse CDF; None without
            a pair.
        histogram: Pairs by number of stale actions, written as text.
    """

    pairs: Count
    unanswered: Count
    mean: Amount | None
    median: Amount | None
    quantiles: dict[str, Count | None]
    histogram: dict[str, Count]


class GivenResponse(Block, frozen=True, kw_only=True):
    """Results over the pairs in which a query followed the event.

    Attributes:
        base_success: Base success rate.
        dynamic_success: Dynamic success rate.
        paired_change: Mean of Dynamic less Base success.
        outcomes: Pairs by outcome.
    """

    base_success: Ratio
    dynamic_success: Ratio
    paired_change: Ratio
    outcomes: Outcomes


class Measure(Block, frozen=True, kw_only=True, omit_defaults=True):
    """A number of a section of the report.

    Attributes:
        key: Name in gates.
        unit: share (of 1), change (a difference of shares), error (a standard error of one), variance, steps,
            more steps (a difference), m, m/s^3, times (a ratio).
        value: The number; None where there is none.
        lower: Lower end of its 95% interval; None where there is none.
        upper: Upper end of the same.
        count: Numerator of a share, or pairs that have the quantity.
        of: Pairs that were asked.
        lack: Reason for a lacking number or interval; empty where none is needed.
    """

    key: Text
    unit: Text
    value: float | None
    lower: float | None = None
    upper: float | None = None
    count: Count | None = None
    of: Count | None = None
    lack: str = ""


class ProbeMean(Block, frozen=True, kw_only=True):
    """A column of a probe in an arm, over the pairs that have it. True counts as 1, so a mean is a share.

    Attributes:
        pairs: Number of these pairs.
        mean: Mean over them.
        largest: Largest value of a pair.
    """

    pairs: Positive
    mean: float
    largest: float


class Result(Block, frozen=True, kw_only=True, omit_defaults=True):
    """The result of a set of pairs: a row of the tables.

    Attributes:
        planned: Planned pairs of the group.
        played: Played pairs of the group; everything below is over these.
        base_success: Base success rate.
        dynamic_success: Dynamic success rate.
        paired_change: Mean of Dynamic less Base success.
        by_task: The rates with their intervals for statements about other tasks.
        outcomes: Pairs by outcome, written (Base, Dynamic).
        conditional_regression: Of the Base successes, those that fail in Dynamic.
        retained: Dynamic successes over Base successes, newly solved cases included.
        mcnemar: Exact two-sided McNemar test of regressions against gains.
        trigger_coverage: Pairs whose event fired.
        response_coverage: Pairs in which the policy was queried after the event.
        stale_actions: Queued actions executed between the event and the next query, with latency its answer,
            over the pairs that have one. They measure the delay of feedback under the policy's own serving
            protocol, not whether a change was noticed.
        given_response: The same results over the pairs in which a query followed the event. The rollout
            itself decides whether one did, so these do not replace the results over all pairs.
        floor: True if Base success is below the level at which a small change says nothing about robustness;
            None without a pair.
        probes: By probe, column and arm, joined by dots: columns of the probes that were asked for; those of
            lists and of texts are left out.
    """

    planned: Count
    played: Count
    base_success: Rate
    dynamic_success: Rate
    paired_change: Change
    by_task: RatesByTask
    outcomes: Outcomes
    conditional_regression: Rate
    retained: Ratio
    mcnemar: McNemar
    trigger_coverage: Rate
    response_coverage: Rate
    stale_actions: StaleActions
    given_response: GivenResponse
    floor: bool | None
    probes: dict[str, ProbeMean] = field(default_factory=dict)


class Macro(Block, frozen=True, kw_only=True):
    """Unweighted means over groups.

    Attributes:
        groups: Number of groups that were averaged.
        base_success: Mean of the groups' Base success rates, 0 to 1; None where a group has no played pair.
        dynamic_success: Mean of the groups' Dynamic success rates, 0 to 1; None where a group has no played
            pair.
        paired_change: Mean of the groups' paired changes, -1 to 1; None where a group has no played pair.
    """

    groups: Count
    base_success: Share | None
    dynamic_success: Share | None
    paired_change: Difference | None


class Split(Block, frozen=True, kw_only=True):
    """The event whose parameter variants differ most in Dynamic success.

    Attributes:
        event: Name of the event.
        dynamic_success: Dynamic success rate, 0 to 1, by variant.
        difference: Largest less smallest of these rates, 0 to 1.
    """

    event: Text
    dynamic_success: dict[str, Share | None]
    difference: Share | None


class SuccessDifference(Block, frozen=True, kw_only=True):
    """Success of the second run less that of the first.

    Attributes:
        value: Estimate, -1 to 1.
        lower: Lower end of the 95% interval.
        upper: Upper end of the 95% interval.
        simultaneous: The interval at the level 1 - 0.05 / m for a family of m contrasts: all of them together
            hold their differences with 95%.
        bootstrap: The paired percentile bootstrap, as in the paper.
        by_task: The 95% interval that takes the cases of a task as one draw; None in a gate's contrast.
    """

    value: Difference | None
    lower: Difference | None
    upper: Difference | None
    simultaneous: Interval
    bootstrap: Interval
    by_task: IntervalByTask | None = None


class SuccessContrast(Block, frozen=True, kw_only=True):
    """A contrast of the success of two runs.

    Attributes:
        first: Name of the first run.
        second: Name of the second run.
        cases: Cases that both runs played.
        first_only: Cases in which only the first run succeeds.
        second_only: Cases in which only the second run succeeds.
        difference: Success of the second less that of the first.
        p_value: Exact two-sided McNemar test of this contrast alone; 1 where no case tells the runs apart,
            None without a case.
        log10_p_value: Decimal logarithm of the same.
        log10_p_value_holm: Decimal logarithm of the p-value after Holm's correction over the family.
    """

    first: Text
    second: Text
    cases: Count
    first_only: Count
    second_only: Count
    difference: SuccessDifference
    p_value: Share | None
    log10_p_value: Log10 | None
    log10_p_value_holm: Log10 | None


class ChangeDifference(Block, frozen=True, kw_only=True):
    """Paired change of the second run less that of the first.

    Attributes:
        value: Estimate, -2 to 2.
        lower: Lower end of the 95% interval.
        upper: Upper end of the 95% interval.
        simultaneous: The interval at the level 1 - 0.05 / m for a family of m contrasts.
        by_task: The 95% interval that takes the cases of a task as one draw.
    """

    value: WideDifference | None
    lower: WideDifference | None
    upper: WideDifference | None
    simultaneous: Interval
    by_task: IntervalByTask | None = None


class ChangeContrast(Block, frozen=True, kw_only=True):
    """A contrast of the paired changes of two runs.

    Attributes:
        first: Name of the first run.
        second: Name of the second run.
        second_lower: Cases in which the second run loses more, or gains less, than the first.
        second_higher: Cases in which it loses less, or gains more.
        difference: Paired change of the second less that of the first.
        log10_p_value: Decimal logarithm of the p-value of the exact sign-flip test of this contrast alone.
        log10_p_value_holm: Decimal logarithm of the p-value after Holm's correction over the family.
    """

    first: Text
    second: Text
    second_lower: Count
    second_higher: Count
    difference: ChangeDifference
    log10_p_value: Log10 | None
    log10_p_value_holm: Log10 | None


class GroupDifference(Block, frozen=True, kw_only=True):
    """Value of the second run less that of the first, in an event.

    Attributes:
        value: Estimate.
        simultaneous: The interval at the level 1 - 0.05 / m for a family of m contrasts.
    """

    value: WideDifference | None
    simultaneous: Interval


class GroupContrast(Block, frozen=True, kw_only=True):
    """A contrast of two runs in an event.

    Attributes:
        first: Name of the first run.
        second: Name of the second run.
        cases: Common cases of the event.
        difference: Value of the second less that of the first.
        log10_p_value_holm: Decimal logarithm of the p-value after Holm's correction over the family.
    """

    first: Text
    second: Text
    cases: Count
    difference: GroupDifference
    log10_p_value_holm: Log10 | None


class Substrate(Block, frozen=True, kw_only=True):
    """The substrate of a run, and the standing of its scores.

    Attributes:
        name: Name of the substrate, for example embedded or libero.
        scores_comparable_with_published: False where scores must not be compared with published ones; None
            where that depends on the installations, event semantics and variations in the provenance.
        note: A sentence to print beside every score; None where none is needed.
    """

    name: Text
    scores_comparable_with_published: bool | None
    note: str | None
