"""Blocks of reports: rates, changes, intervals and contrasts, which statistics return and documents hold.

The schemas of ``report.json`` and ``comparison.json`` are made from these classes and their docstrings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from msgspec import Meta, Struct, field, structs

from pytest_libero_max.stats import ratios

if TYPE_CHECKING:
    from pytest_libero_max.stats import intervals


FLOOR_BASE_RATE = 0.2
"""Below this Base success rate a small change does not show a successful response (the paper's limit)."""

_LARGEST = 2**63 - 1  # as in benchmark/structs.py, which statistics do not import

Count = Annotated[int, Meta(ge=0, le=_LARGEST)]
Positive = Annotated[int, Meta(ge=1, le=_LARGEST)]
Text = Annotated[str, Meta(min_length=1)]
Share = Annotated[float, Meta(ge=0, le=1)]
Difference = Annotated[float, Meta(ge=-1, le=1)]
WideDifference = Annotated[float, Meta(ge=-2, le=2)]
Log10 = Annotated[float, Meta(le=0)]
Amount = Annotated[float, Meta(ge=0)]


class Block(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A JSON object of a report: exactly these fields, in this order."""


class Ratio(Block, frozen=True, kw_only=True):
    """A ratio with its counts."""

    count: int
    """Numerator; negative for a loss."""
    of: Count
    """Denominator."""
    value: float | None
    """count / of; None where the denominator is zero."""


class Rate(Block, frozen=True, kw_only=True):
    """A rate with its counts and 95% interval; None where the denominator is zero."""

    count: Count
    """Pairs that have the property."""
    of: Count
    """Pairs that were asked: the denominator."""
    value: Share | None
    """count / of, 0 to 1; None where the denominator is zero."""
    lower: Share | None
    """Lower end of the exact 95% interval (Clopper and Pearson); None where a rule stopped the run."""
    upper: Share | None
    """Upper end of the exact 95% interval (Clopper and Pearson); None where a rule stopped the run."""


class Interval(Block, frozen=True, kw_only=True):
    """A 95% interval."""

    lower: WideDifference | None
    """Lower end; None where there is none."""
    upper: WideDifference | None
    """Upper end; None where there is none."""


class IntervalByTask(Block, frozen=True, kw_only=True, omit_defaults=True):
    """A 95% interval for statements about other tasks: tasks are resampled with all their pairs."""

    tasks: Count
    """Tasks that the pairs are of."""
    effective_tasks: Amount
    """(sum of n)^2 / (sum of n^2) over the numbers of pairs of the tasks."""
    changed_tasks: Count
    """Tasks in which a pair changed; between runs, with a case that tells them apart; for a rate, the smaller
    of the tasks with a success and those with a failure."""
    lower: WideDifference | None
    """Lower end; None where too few tasks changed to decide."""
    upper: WideDifference | None
    """Upper end; None where too few tasks changed to decide."""
    withheld: bool = False
    """True if a rule stopped the run, so that it has no intervals."""

    @property
    def interval(self) -> intervals.Interval | None:
        """Both ends; None where it cannot be decided."""
        if self.lower is None or self.upper is None:
            return None
        from pytest_libero_max.stats import intervals  # with NumPy, which pytest's start does without

        return intervals.Interval(self.lower, self.upper)


class TaskInterval(IntervalByTask, frozen=True, kw_only=True, omit_defaults=True):
    """A 95% interval for statements about other tasks, with the estimate."""

    value: WideDifference | None
    """The estimate over all pairs."""


class RatesByTask(Block, frozen=True, kw_only=True):
    """Rates with their intervals for statements about other tasks."""

    base_success: TaskInterval
    """Base success rate."""
    dynamic_success: TaskInterval
    """Dynamic success rate."""
    conditional_regression: TaskInterval
    """Share of Base successes lost."""


class Bootstrap(Block, frozen=True, kw_only=True):
    """The paper's percentile bootstrap."""

    lower: WideDifference | None
    """Lower end of the 95% interval."""
    upper: WideDifference | None
    """Upper end of the 95% interval."""
    degenerate: bool | None
    """True if all differences are equal, so that the interval has no width and says nothing about
    precision."""


class Bootstraps(Bootstrap, frozen=True, kw_only=True):
    """The paper's percentile bootstrap over all pairs alike, and with the sources kept."""

    by_source: Bootstrap
    """The same with the number of pairs of each source kept."""


class MeanDifference(Block, frozen=True, kw_only=True):
    """A mean of paired differences of success with its interval."""

    count: int
    """Pairs in which only the one succeeds, less those in which only the other does."""
    of: Count
    """Pairs: the denominator."""
    value: Difference | None
    """count / of, -1 to 1."""
    lower: Difference | None
    """Lower end of the melded exact 95% interval, which takes all pairs as independent; None where a rule
    stopped the run."""
    upper: Difference | None
    """Upper end of the melded exact 95% interval; None where a rule stopped the run."""


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
    """Pairs by outcome, written (Base, Dynamic)."""

    preserved_success: Count
    """Pairs that succeed in Base and in Dynamic, (1,1)."""
    change_associated_success: Count
    """Pairs that fail in Base and succeed in Dynamic, (0,1)."""
    regression: Count
    """Pairs that succeed in Base and fail in Dynamic, (1,0)."""
    persistent_failure: Count
    """Pairs that fail in both, (0,0)."""

    @property
    def total(self) -> int:
        return sum(structs.astuple(self))

    @property
    def base(self) -> ratios.Ratio:
        return ratios.Ratio(self.preserved_success + self.regression, self.total)

    @property
    def dynamic(self) -> ratios.Ratio:
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
    """Exact two-sided McNemar test of regressions against gains."""

    regressions: Count
    """Pairs (1,0)."""
    gains: Count
    """Pairs (0,1)."""
    p_value: Share | None
    """0 where below the smallest double; the logarithm stays exact."""
    log10_p_value: Log10 | None
    """Decimal logarithm of the p-value; None without a pair (1,0) or (0,1), and where a rule stopped the
    run."""


class StaleActions(Block, frozen=True, kw_only=True):
    """Queued actions executed between the event and the next query."""

    pairs: Count
    """Pairs in which a query followed the event."""
    unanswered: Count
    """Pairs whose episode ended between the event and the next query; not counted in the numbers below."""
    mean: Amount | None
    """Mean number of actions executed between the event and the next query; None without a pair."""
    median: Amount | None
    """Median of the same; the mean of the middle two for an even number of pairs."""
    quantiles: dict[str, Count | None]
    """Quantiles of the same by probability (0.05, 0.25, 0.75, 0.95), by inverse CDF; None without a pair."""
    histogram: dict[str, Count]
    """Pairs by number of stale actions, written as text."""


class GivenResponse(Block, frozen=True, kw_only=True):
    """Results over the pairs in which a query followed the event."""

    base_success: Ratio
    """Base success rate."""
    dynamic_success: Ratio
    """Dynamic success rate."""
    paired_change: Ratio
    """Mean of Dynamic less Base success."""
    outcomes: Outcomes
    """Pairs by outcome."""


class Measure(Block, frozen=True, kw_only=True, omit_defaults=True):
    """A number of a section of the report."""

    key: Text
    """Name in gates."""
    unit: Text
    """share (of 1), change (a difference of shares), error (a standard error of one), variance, steps, more
    steps (a difference), m, m/s^3, times (a ratio), cases, p (a p-value)."""
    value: float | None
    """The number; None where there is none."""
    lower: float | None = None
    """Lower end of its 95% interval; None where there is none."""
    upper: float | None = None
    """Upper end of the same."""
    count: Count | None = None
    """Numerator of a share, or pairs that have the quantity."""
    of: Count | None = None
    """Pairs that were asked."""
    lack: str = ""
    """Reason for a lacking number or interval; empty where none is needed."""


class ProbeMean(Block, frozen=True, kw_only=True):
    """A column of a probe in an arm, over the pairs that have it. True counts as 1, so a mean is a share."""

    pairs: Positive
    """Number of these pairs."""
    mean: float
    """Mean over them."""
    largest: float
    """Largest value of a pair."""


class Result(Block, frozen=True, kw_only=True, omit_defaults=True):
    """The result of a set of pairs: a row of the tables."""

    planned: Count
    """Planned pairs of the group."""
    played: Count
    """Played pairs of the group; everything below is over these."""
    base_success: Rate
    """Base success rate."""
    dynamic_success: Rate
    """Dynamic success rate."""
    paired_change: Change
    """Mean of Dynamic less Base success."""
    by_task: RatesByTask
    """The rates with their intervals for statements about other tasks."""
    outcomes: Outcomes
    """Pairs by outcome, written (Base, Dynamic)."""
    conditional_regression: Rate
    """Share of the Base successes that fail in Dynamic."""
    retained: Ratio
    """Dynamic successes over Base successes, newly solved cases included."""
    mcnemar: McNemar
    """Exact two-sided McNemar test of regressions against gains."""
    trigger_coverage: Rate
    """Pairs whose event fired."""
    response_coverage: Rate
    """Pairs in which the policy was queried after the event."""
    stale_actions: StaleActions
    """Queued actions executed between the event and the next query, with latency its answer, over the pairs
    that have one. They measure the delay of feedback under the policy's own serving protocol, not whether a
    change was noticed."""
    given_response: GivenResponse
    """The same results over the pairs in which a query followed the event. The rollout itself decides whether
    one did, so these do not replace the results over all pairs."""
    floor: bool | None
    """True if Base success is below the level at which a small change says nothing about robustness; None
    without a pair."""
    probes: dict[str, ProbeMean] = field(default_factory=dict)
    """By probe, column and arm, joined by dots: columns of the probes that were asked for; those of lists and
    of texts are left out."""


class Macro(Block, frozen=True, kw_only=True):
    """Unweighted means over groups."""

    groups: Count
    """Number of groups that were averaged."""
    base_success: Share | None
    """Mean of the groups' Base success rates, 0 to 1; None where a group has no played pair."""
    dynamic_success: Share | None
    """Mean of the groups' Dynamic success rates, 0 to 1; None where a group has no played pair."""
    paired_change: Difference | None
    """Mean of the groups' paired changes, -1 to 1; None where a group has no played pair."""


class Split(Block, frozen=True, kw_only=True):
    """The event whose parameter variants differ most in Dynamic success."""

    event: Text
    """Name of the event."""
    dynamic_success: dict[str, Share | None]
    """Dynamic success rate, 0 to 1, by variant."""
    difference: Share | None
    """Largest less smallest of these rates, 0 to 1."""


class SuccessDifference(Block, frozen=True, kw_only=True):
    """Success of the second run less that of the first."""

    value: Difference | None
    """Estimate, -1 to 1."""
    lower: Difference | None
    """Lower end of the 95% interval."""
    upper: Difference | None
    """Upper end of the 95% interval."""
    simultaneous: Interval
    """The interval at the level 1 - 0.05 / m for a family of m contrasts: all of them together hold their
    differences with 95%."""
    bootstrap: Interval
    """The paired percentile bootstrap, as in the paper."""
    by_task: IntervalByTask | None = None
    """The 95% interval that takes the cases of a task as one draw; None in a gate's contrast."""


class SuccessContrast(Block, frozen=True, kw_only=True):
    """A contrast of the success of two runs."""

    first: Text
    """Name of the first run."""
    second: Text
    """Name of the second run."""
    cases: Count
    """Cases that both runs played."""
    first_only: Count
    """Cases in which only the first run succeeds."""
    second_only: Count
    """Cases in which only the second run succeeds."""
    difference: SuccessDifference
    """Success of the second less that of the first."""
    p_value: Share | None
    """Exact two-sided McNemar test of this contrast alone; 1 where no case tells the runs apart, None without
    a case."""
    log10_p_value: Log10 | None
    """Decimal logarithm of the same."""
    log10_p_value_holm: Log10 | None
    """Decimal logarithm of the p-value after Holm's correction over the family."""


class ChangeDifference(Block, frozen=True, kw_only=True):
    """Paired change of the second run less that of the first."""

    value: WideDifference | None
    """Estimate, -2 to 2."""
    lower: WideDifference | None
    """Lower end of the 95% interval."""
    upper: WideDifference | None
    """Upper end of the 95% interval."""
    simultaneous: Interval
    """The interval at the level 1 - 0.05 / m for a family of m contrasts."""
    by_task: IntervalByTask | None = None
    """The 95% interval that takes the cases of a task as one draw."""


class ChangeContrast(Block, frozen=True, kw_only=True):
    """A contrast of the paired changes of two runs."""

    first: Text
    """Name of the first run."""
    second: Text
    """Name of the second run."""
    second_lower: Count
    """Cases in which the second run loses more, or gains less, than the first."""
    second_higher: Count
    """Cases in which it loses less, or gains more."""
    difference: ChangeDifference
    """Paired change of the second less that of the first."""
    log10_p_value: Log10 | None
    """Decimal logarithm of the p-value of the exact sign-flip test of this contrast alone."""
    log10_p_value_holm: Log10 | None
    """Decimal logarithm of the p-value after Holm's correction over the family."""


class GroupDifference(Block, frozen=True, kw_only=True):
    """Value of the second run less that of the first, in an event."""

    value: WideDifference | None
    """Estimate."""
    simultaneous: Interval
    """The interval at the level 1 - 0.05 / m for a family of m contrasts."""


class GroupContrast(Block, frozen=True, kw_only=True):
    """A contrast of two runs in an event."""

    first: Text
    """Name of the first run."""
    second: Text
    """Name of the second run."""
    cases: Count
    """Common cases of the event."""
    difference: GroupDifference
    """Value of the second less that of the first."""
    log10_p_value_holm: Log10 | None
    """Decimal logarithm of the p-value after Holm's correction over the family."""


class Substrate(Block, frozen=True, kw_only=True):
    """The substrate of a run, and the standing of its scores."""

    name: Text
    """Name of the substrate, for example embedded or libero."""
    scores_comparable_with_published: bool | None
    """False where scores must not be compared with published ones; None where that depends on the
    installations, event semantics and variations in the provenance."""
    note: str | None
    """A sentence to print beside every score; None where none is needed."""


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
