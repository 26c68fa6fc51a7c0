"""``comparison.json`` as one typed document: built by ``comparison.compare``, read by every writer."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from msgspec import Meta

from pytest_libero_max.report.blocks import (
    Block,
    Change,
    Count,
    Difference,
    Interval,
    IntervalByTask,
    Log10,
    Outcomes,
    Positive,
    Rate,
    Result,
    Share,
    Substrate,
    Text,
    WideDifference,
)
from pytest_libero_max.report.report_document import Caveat

COMPARISON_VERSION: Final = 4

Outcome = Literal["preserved_success", "change_associated_success", "regression", "persistent_failure"]


class CommonPairs(Block, frozen=True, kw_only=True):
    """Cases that are compared, and those that are not.

    Attributes:
        common: Cases that every run has measured; all results are over these.
        restricted: True if some run has planned cases that are not compared.
        left_out: By run, the case ids of its planned cases that are not compared.
        unsupported: By compared run, number of its planned cases that its policy declares unsupported. They
            are left out of all runs.
    """

    common: Positive
    restricted: bool
    left_out: dict[str, list[str]]
    unsupported: dict[str, Count]


class RunDifference(Block, frozen=True, kw_only=True):
    """Something in which the runs differ: beside their policies, or in how these ask.

    Attributes:
        field: Place in the provenance; H, Q or repeatable of the policy; or what the records say: scenes,
            what the cases were played in, max_steps, the steps that their episodes may take, renderers, what
            drew their images, ``policy.files.NAME``, a file that the policy has read, or
            ``fingerprints.NAME``, another instrument.
        values: Its value in every run; None where it has none. For scenes, the number of cases that differ
            from the first run.
    """

    field: Text
    values: dict[str, Any]


class LowestEvent(Block, frozen=True, kw_only=True):
    """The lowest paired change of a run in an event, and what chance makes of it.

    Attributes:
        event: The event; None where chance explains the value, or several events have it.
        value: Its paired change.
        by_chance: Its mean if the outcomes were dealt to the events at random.
    """

    event: Text | None
    value: Difference
    by_chance: Difference


class ComparedRun(Block, frozen=True, kw_only=True):
    """One run on the common cases.

    Attributes:
        name: Name of the run: its path as given.
        rank: Rank by Dynamic success on the common cases, 1 for the highest; equal runs share the mean of
            their ranks. None for a run whose policy does not support all of its cases.
        highest_rank: Highest rank that the cases leave open, by the simultaneous intervals of the contrasts:
            one below the runs that they show to be better. Whole, without shared ranks.
        lowest_rank: Lowest rank that they leave open: one above the runs that they show to be worse.
        policy: The policy's spec as played, as in its records.
        replay: Plays a case of this run again once its item id is appended. Empty for the run of another
            evaluation loop, which alone can load its policy.
        base_success: Base success rate on the common cases.
        dynamic_success: Dynamic success rate on the common cases.
        paired_change: Mean of Dynamic less Base success on the common cases.
        outcomes: Pairs by outcome, written (Base, Dynamic).
        conditional_regression: Of the Base successes, those that fail in Dynamic.
        trigger_coverage: Pairs whose event fired.
        response_coverage: Pairs in which the policy was queried after the event.
        by_event: Paired change by event.
        lowest_event: The lowest paired change in an event.
        warnings: What keeps its numbers from saying what they seem to, as sentences.
        caveats: Caveats on its pairs of the common cases.
    """

    name: Text
    rank: Annotated[float, Meta(ge=1)] | None
    highest_rank: Positive | None
    lowest_rank: Positive | None
    policy: dict[str, Any] | None
    replay: list[str]
    base_success: Rate
    dynamic_success: Rate
    paired_change: Change
    outcomes: Outcomes
    conditional_regression: Rate
    trigger_coverage: Rate
    response_coverage: Rate
    by_event: dict[str, Change]
    lowest_event: LowestEvent
    warnings: list[str]
    caveats: list[Caveat]


class ApartRun(Block, frozen=True, kw_only=True):
    """A run whose policy does not support all suites of the others. It has no rank and no contrast.

    Attributes:
        name: Name of the run: its path as given.
        policy: The policy's spec as played, as in its records.
        unsupported: Number of its planned cases that its policy declares unsupported.
        unsupported_suites: The suites of these cases.
        result: Its result over the cases that its policy supports.
        by_suite: The same by suite.
        warnings: What keeps its numbers from saying what they seem to, as sentences.
        caveats: Caveats on its pairs.
    """

    name: Text
    policy: dict[str, Any] | None
    unsupported: Positive
    unsupported_suites: list[str]
    result: Result
    by_suite: dict[str, Result]
    warnings: list[str]
    caveats: list[Caveat]


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


class EventContrasts(Block, frozen=True, kw_only=True):
    """Contrasts in an event.

    Attributes:
        dynamic_success: Contrasts of Dynamic success.
        paired_change: Contrasts of the paired change.
    """

    dynamic_success: list[GroupContrast]
    paired_change: list[GroupContrast]


class OverRuns(Block, frozen=True, kw_only=True):
    """The paired changes of the runs in an event.

    Attributes:
        lowest: Lowest paired change of a run.
        lower_quartile: Lower quartile over the runs, linear between two of them.
        median: Median over the runs.
        upper_quartile: Upper quartile over the runs, linear between two of them.
        highest: Highest paired change of a run.
    """

    lowest: Difference
    lower_quartile: Difference
    median: Difference
    upper_quartile: Difference
    highest: Difference


class EventProfiles(Block, frozen=True, kw_only=True):
    """Agreement of the runs in how they rank the events: Spearman's rank correlation of every two runs.

    Attributes:
        mean_spearman: Mean over all pairs of runs that have a correlation; None where none has.
        lowest: Smallest of them.
        highest: Largest of them.
    """

    mean_spearman: Difference | None
    lowest: Difference | None
    highest: Difference | None


class Flip(Block, frozen=True, kw_only=True):
    """A case whose outcome differs between runs.

    Attributes:
        case_id: Id of the case in its manifest.
        item_id: Name of the test item; select it with -k.
        outcomes: By run, the outcome of the pair.
    """

    case_id: Text
    item_id: Text
    outcomes: dict[str, Outcome]


class Comparison(Block, frozen=True, kw_only=True):
    """Several runs on the same cases.

    Attributes:
        schema_version: Version of this document's form; it changes when a field is added, removed or given
            another meaning.
        pairs: Cases that are compared, and those that are not.
        substrate: The substrate of the runs, and the standing of its scores.
        differences: Everything in which the runs differ beside their policies: substrate with semantics,
            instruction source, variations and installations; protocol; cases; versions; renderers. Of the
            policies H (chunk size), Q (execution horizon) and whether they are repeatable.
        policies: What is not the same in policies of one name, files that they read among it; empty for
            policies of several names.
        runs: One entry a compared run, in the order given. A run that a rule stopped has no intervals, and
            neither have its contrasts.
        apart: Runs of policies that do not support all suites of the others, where two others are left to
            compare. They change nothing else here.
        contrasts: Contrasts of Dynamic success on the common cases; one family over all pairs of runs.
        base_contrasts: Contrasts of Base success; one family over all pairs of runs.
        change_contrasts: Contrasts of the paired change; one family over all pairs of runs.
        by_event: Contrasts by event; for each quantity one family over all events and pairs of runs.
        events: By event: the paired changes of the runs together.
        event_profiles: Agreement of the runs in how they rank the events by paired change.
        flips: Cases whose outcome differs between runs.
        statements: Limits of these numbers: sentences by a stable key.
    """

    schema_version: Literal[4] = COMPARISON_VERSION
    pairs: CommonPairs
    substrate: Substrate
    differences: list[RunDifference]
    policies: list[RunDifference]
    runs: Annotated[list[ComparedRun], Meta(min_length=2)]
    apart: list[ApartRun]
    contrasts: list[SuccessContrast]
    base_contrasts: list[SuccessContrast]
    change_contrasts: list[ChangeContrast]
    by_event: dict[str, EventContrasts]
    events: dict[str, OverRuns]
    event_profiles: EventProfiles
    flips: list[Flip]
    statements: dict[str, Text]
