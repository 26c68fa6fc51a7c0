"""``comparison.json`` as one typed document: built by ``comparison.compare``, read by every writer."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from msgspec import Meta

from pytest_libero_max.report.report_document import Caveat
from pytest_libero_max.stats.blocks import (
    Block,
    Change,
    ChangeContrast,
    Count,
    Difference,
    GroupContrast,
    Outcomes,
    Positive,
    Rate,
    Result,
    Substrate,
    SuccessContrast,
    Text,
)

COMPARISON_VERSION: Final = 4

Outcome = Literal["preserved_success", "change_associated_success", "regression", "persistent_failure"]


class CommonPairs(Block, frozen=True, kw_only=True):
    """Cases that are compared, and those that are not."""

    common: Positive
    """Cases that every run has measured; all results are over these."""
    restricted: bool
    """True if some run has planned cases that are not compared."""
    left_out: dict[str, list[str]]
    """By run, the case ids of its planned cases that are not compared."""
    unsupported: dict[str, Count]
    """By compared run, number of its planned cases that its policy declares unsupported. They are left out of
    all runs."""


class RunDifference(Block, frozen=True, kw_only=True):
    """Something in which the runs differ: beside their policies, or in how these ask."""

    field: Text
    """Place in the provenance; H, Q or repeatable of the policy; or what the records say: scenes, what the
    cases were played in, max_steps, the steps that their episodes may take, renderers, what drew their
    images, ``policy.files.NAME``, a file that the policy has read, or ``fingerprints.NAME``, another
    instrument."""
    values: dict[str, Any]
    """Its value in every run; None where it has none. For scenes, the number of cases that differ from the
    first run."""


class LowestEvent(Block, frozen=True, kw_only=True):
    """The lowest paired change of a run in an event, and what chance makes of it."""

    event: Text | None
    """The event; None where chance explains the value, or several events have it."""
    value: Difference
    """Its paired change."""
    by_chance: Difference
    """Its mean if the outcomes were dealt to the events at random."""


class ComparedRun(Block, frozen=True, kw_only=True):
    """One run on the common cases."""

    name: Text
    """Name of the run: its path as given."""
    rank: Annotated[float, Meta(ge=1)] | None
    """Rank by Dynamic success on the common cases, 1 for the highest; equal runs share the mean of their
    ranks. None for a run whose policy does not support all of its cases."""
    highest_rank: Positive | None
    """Highest rank that the cases leave open, by the simultaneous intervals of the contrasts: one below the
    runs that they show to be better. Whole, without shared ranks."""
    lowest_rank: Positive | None
    """Lowest rank that they leave open: one above the runs that they show to be worse."""
    policy: dict[str, Any] | None
    """The policy's spec as played, as in its records."""
    replay: list[str]
    """Plays a case of this run again once its item id is appended. Empty for the run of another evaluation
    loop, which alone can load its policy."""
    base_success: Rate
    """Base success rate on the common cases."""
    dynamic_success: Rate
    """Dynamic success rate on the common cases."""
    paired_change: Change
    """Mean of Dynamic less Base success on the common cases."""
    outcomes: Outcomes
    """Pairs by outcome, written (Base, Dynamic)."""
    conditional_regression: Rate
    """Of the Base successes, those that fail in Dynamic."""
    trigger_coverage: Rate
    """Pairs whose event fired."""
    response_coverage: Rate
    """Pairs in which the policy was queried after the event."""
    by_event: dict[str, Change]
    """Paired change by event."""
    lowest_event: LowestEvent
    """The lowest paired change in an event."""
    warnings: list[str]
    """What keeps its numbers from saying what they seem to, as sentences."""
    caveats: list[Caveat]
    """Caveats on its pairs of the common cases."""


class ApartRun(Block, frozen=True, kw_only=True):
    """A run whose policy does not support all suites of the others. It has no rank and no contrast."""

    name: Text
    """Name of the run: its path as given."""
    policy: dict[str, Any] | None
    """The policy's spec as played, as in its records."""
    unsupported: Positive
    """Number of its planned cases that its policy declares unsupported."""
    unsupported_suites: list[str]
    """The suites of these cases."""
    result: Result
    """Its result over the cases that its policy supports."""
    by_suite: dict[str, Result]
    """The same by suite."""
    warnings: list[str]
    """What keeps its numbers from saying what they seem to, as sentences."""
    caveats: list[Caveat]
    """Caveats on its pairs."""


class EventContrasts(Block, frozen=True, kw_only=True):
    """Contrasts in an event."""

    dynamic_success: list[GroupContrast]
    """Contrasts of Dynamic success."""
    paired_change: list[GroupContrast]
    """Contrasts of the paired change."""


class OverRuns(Block, frozen=True, kw_only=True):
    """The paired changes of the runs in an event."""

    lowest: Difference
    """Lowest paired change of a run."""
    lower_quartile: Difference
    """Lower quartile over the runs, linear between two of them."""
    median: Difference
    """Median over the runs."""
    upper_quartile: Difference
    """Upper quartile over the runs, linear between two of them."""
    highest: Difference
    """Highest paired change of a run."""


class EventProfiles(Block, frozen=True, kw_only=True):
    """Agreement of the runs in how they rank the events: Spearman's rank correlation of every two runs."""

    mean_spearman: Difference | None
    """Mean over all pairs of runs that have a correlation; None where none has."""
    lowest: Difference | None
    """Smallest of them."""
    highest: Difference | None
    """Largest of them."""


class Flip(Block, frozen=True, kw_only=True):
    """A case whose outcome differs between runs."""

    case_id: Text
    """Id of the case in its manifest."""
    item_id: Text
    """Name of the test item; select it with -k."""
    outcomes: dict[str, Outcome]
    """By run, the outcome of the pair."""


class Comparison(Block, frozen=True, kw_only=True):
    """Several runs on the same cases."""

    schema_version: Literal[4] = COMPARISON_VERSION
    """Version of this document's form; it changes when a field is added, removed or given another meaning."""
    pairs: CommonPairs
    """Cases that are compared, and those that are not."""
    substrate: Substrate
    """The substrate of the runs, and the standing of its scores."""
    differences: list[RunDifference]
    """Everything in which the runs differ beside their policies: substrate with semantics, instruction
    source, variations and installations; protocol; cases; versions; renderers. Of the policies H (chunk
    size), Q (execution horizon) and whether they are repeatable."""
    policies: list[RunDifference]
    """What is not the same in policies of one name, files that they read among it; empty for policies of
    several names."""
    runs: Annotated[list[ComparedRun], Meta(min_length=2)]
    """One entry a compared run, in the order given. A run that a rule stopped has no intervals, and neither
    have its contrasts."""
    apart: list[ApartRun]
    """Runs of policies that do not support all suites of the others, where two others are left to compare.
    They change nothing else here."""
    contrasts: list[SuccessContrast]
    """Contrasts of Dynamic success on the common cases; one family over all pairs of runs."""
    base_contrasts: list[SuccessContrast]
    """Contrasts of Base success; one family over all pairs of runs."""
    change_contrasts: list[ChangeContrast]
    """Contrasts of the paired change; one family over all pairs of runs."""
    by_event: dict[str, EventContrasts]
    """Contrasts by event; for each quantity one family over all events and pairs of runs."""
    events: dict[str, OverRuns]
    """By event: the paired changes of the runs together."""
    event_profiles: EventProfiles
    """Agreement of the runs in how they rank the events by paired change."""
    flips: list[Flip]
    """Cases whose outcome differs between runs."""
    statements: dict[str, Text]
    """Limits of these numbers: sentences by a stable key."""
