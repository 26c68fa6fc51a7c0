"""``report.json`` as one typed document: built by ``report.build``, read by every writer, gate and reader."""

from __future__ import annotations

from typing import Any, Final, Literal

from msgspec import field

from pytest_libero_max.report.studies.study_document import Study
from pytest_libero_max.stats.blocks import (
    Block,
    Change,
    Count,
    Macro,
    Measure,
    Outcomes,
    Positive,
    Rate,
    Ratio,
    Result,
    Share,
    Split,
    Substrate,
    Text,
)

REPORT_VERSION: Final = 7


class Watched(Block, frozen=True, kw_only=True):
    """What a stopping rule knows of a quantity over all planned pairs, in place of an interval of its own."""

    what: Text
    """The gate, or the quantity where the rule watched no gate."""
    verdict: Literal["passed", "failed", "undecidable"] | None
    """Verdict on the gate; None for a quantity."""
    value: float | None
    """End of the quantity's range that decides the gate; None where nothing or both ends do."""
    lower: float | None
    """Smallest value that the estimate can have over all planned pairs, as the rule sees it; None where the
    rule gives none."""
    upper: float | None
    """Largest value."""
    level: Share | None
    """Probability that the rule errs; None where it is certain."""
    not_shown: bool
    """True for a gate on an end of an interval that failed, and whose other end may meet it."""
    detail: Text
    """What the rule knows, for people."""

    @property
    def text(self) -> str:
        return f"{self.what}: {'' if self.verdict is None else f'{self.verdict}, '}{self.detail}"


class Stop(Block, frozen=True, kw_only=True):
    """Reason a run was stopped before every planned pair was played."""

    reason: Text
    """For people, without a period."""
    of: Positive
    """Number of planned pairs."""
    rule: str | None
    """The stopping rule as asked for; None where something broke, or -x stopped the run."""
    at: Count | None
    """Number of pairs, the first ones in the order of play, on which the rule decided; None without a
    rule."""
    bias: str | None = None
    """The way in which the estimates of such a run are off on average; None where the rule does not look at
    outcomes, and without a rule."""
    watched: list[Watched]
    """What the rule knows of the gates, or of the quantity, that it watched; empty for other rules."""


class MissingPair(Block, frozen=True, kw_only=True):
    """A planned pair with neither a record nor an error."""

    case_id: Text
    """Id of the case in its manifest."""
    item_id: Text
    """Name of the test item; select it with -k."""


class InvalidPair(MissingPair, frozen=True, kw_only=True):
    """A pair that could not be measured."""

    phase: str
    """Part in which it failed: setup, base, dynamic, crash, or the name of another arm."""
    kind: str
    """Type of the error."""
    message: str
    """Message of the error."""


class PairCounts(Block, frozen=True, kw_only=True):
    """Pairs that were planned, played and lost, and which were lost."""

    planned: Count
    """Assigned pairs; the denominator of the headline."""
    played: Count
    """Pairs with a valid record."""
    invalid: Count
    """Pairs that could not be measured because of an error of the machinery, never of the policy."""
    missing: Count
    """Planned pairs with neither a record nor an error."""
    complete: bool
    """True if every planned pair was played, at least one was planned, and no shard lacks."""
    missing_shards: list[str]
    """Shards that the merged runs lack, for example 3/4; a run without one of its shards is not complete."""
    invalid_pairs: list[InvalidPair]
    """The invalid pairs in the order of their case ids."""
    missing_pairs: list[MissingPair]
    """The missing pairs in the order of their case ids."""
    repaired_pairs: list[str]
    """Item ids of pairs that were measured when they were played again after an error."""
    unsupported: Count
    """Pairs of suites that the policy declares it does not support. They are not among the planned ones:
    neither played nor failed."""
    unsupported_suites: list[str]
    """The suites of these pairs."""
    stopped: Stop | None = None
    """Reason the run was stopped before every planned pair was played; None where it was not."""

    @property
    def has_intervals(self) -> bool:
        """True unless a rule stopped the run: intervals are for a fixed number of pairs."""
        return self.stopped is None or self.stopped.rule is None


class PresentShards(Block, frozen=True, kw_only=True):
    """Parts of a divided case set that are here."""

    of: Positive
    """Number of parts."""
    present: list[Positive]
    """Numbers of those that are here, from 1."""


class PlayedSelection(Block, frozen=True, kw_only=True):
    """The part of the case set that was played."""

    asked: list[str]
    """The user's selection, as the command line spells it."""
    chosen: Count
    """Number of cases that the run plays."""
    of: Count
    """Number of cases of the whole track or manifest."""
    digest: Text
    """SHA-256 of the sorted ids of the chosen cases, hexadecimal."""
    shards: PresentShards | None
    """Shards that these are; None where the cases were not divided, or where all shards are here."""
    merged: bool
    """True if this is several runs joined."""
    whole: bool
    """True if these are all cases of the track or manifest."""
    missing_shards: list[str]
    """Shards that a merge lacks, for example 3/4."""
    text: Text
    """The selection in words."""


class Headline(Block, frozen=True, kw_only=True):
    """Rates over all planned pairs."""

    status: Literal["complete", "withheld"]
    """complete where every planned pair was played; otherwise withheld, and the rates are None."""
    reason: str | None
    """Reason the rates are withheld; None where they are not."""
    base_success: Rate | None = None
    """Base success rate."""
    dynamic_success: Rate | None = None
    """Dynamic success rate."""
    paired_change: Change | None = None
    """Mean of Dynamic less Base success."""


class MissingAsFailures(Block, frozen=True, kw_only=True):
    """Rates over all planned pairs, in which a pair without a result counts as a failure in both arms.

    The paper counts a missing terminal result so. It is no score of this run: a simulator, server or protocol
    fault is not the policy's, and the pair can be played again.
    """

    without_result: Positive
    """Planned pairs without a record, missing or invalid."""
    base_success: Rate
    """Base success rate."""
    dynamic_success: Rate
    """Dynamic success rate."""
    paired_change: Ratio
    """Mean of Dynamic less Base success."""


class Caveat(Block, frozen=True, kw_only=True):
    """A note on pairs whose scene, prompt or event differs from its name."""

    name: Text
    """Stable key of the caveat."""
    pairs: Positive
    """Played pairs that it concerns."""
    played: Positive
    """All played pairs."""
    text: Text
    """The note, as a sentence."""


class Returned(Block, frozen=True, kw_only=True):
    """Numbers of actions that servers returned to a query, before they were cut to H."""

    least: Positive
    """The smallest."""
    most: Positive
    """The largest."""


class ClippedActions(Block, frozen=True, kw_only=True):
    """Action components outside [-1, 1], which the controller clips."""

    pairs: Count
    """Pairs with an executed action that had a component outside [-1, 1]."""
    largest_share: Share
    """Largest share of such components in a rollout, over the 7 components of every executed action."""


class Cell(Block, frozen=True, kw_only=True):
    """A source category under an event."""

    planned: Count
    """Planned pairs of the cell."""
    outcomes: Outcomes
    """Outcomes of its played pairs."""
    paired_change: Ratio
    """Paired change over its played pairs, without an interval."""


class Macros(Block, frozen=True, kw_only=True):
    """Unweighted means over groups; secondary to the rates over all pairs."""

    category: Macro
    """Over source categories."""


class Extremes(Block, frozen=True, kw_only=True):
    """Source categories that stand out, the first by name among equals."""

    lowest_base_success: Text
    """The category of lowest Base success."""
    largest_loss: Text
    """The category of lowest paired change."""


class ChangedPair(Block, frozen=True, kw_only=True):
    """A pair of which one arm succeeded and the other failed, and the cause of that failure."""

    item_id: Text
    """Name of the test item; select it with -k."""
    event: Text
    """Name of the event."""
    outcome: Literal["regression", "change_associated_success"]
    """regression, where Dynamic failed, or change_associated_success, where Base did."""
    cause: Text
    """Of the failed arm; see the list of causes."""
    sentence: Text
    """The cause with its numbers."""

    @property
    def program(self) -> str:
        """Name of the program that the pair plays, with which its item id ends; empty where it has none."""
        return self.item_id.partition(f"-{self.event}-v")[2].partition("-")[2]


class BaseFailures(Block, frozen=True, kw_only=True):
    """Failures of Base of one cause."""

    cause: Text
    """The cause; see the list of causes."""
    pairs: Positive
    """Number of pairs."""
    item_ids: list[Text]
    """Names of the first of them, by name."""
    sentence: Text
    """The cause with the numbers of the first pair."""


class SuccessCurves(Block, frozen=True, kw_only=True):
    """Survival curves of Base and Dynamic over the same pairs: nothing is censored before an episode ends."""

    pairs: Count
    """Played pairs."""
    steps: list[Count]
    """Policy steps at which a pair is completed; 0 and the longest episode as well."""
    base: list[Count]
    """Number of pairs that Base has not completed by each of these."""
    dynamic: list[Count]
    """Number of pairs that Dynamic has not completed by then."""


class Inference(Block, frozen=True, kw_only=True):
    """Protocol class of a run: what the world does while the policy is asked."""

    world: Literal["paused", "goes on"]
    """What it does in Base and Dynamic."""
    late: dict[str, list[Text]]
    """By arm the times that queries take, for example ``4steps``; empty where the world always waits."""
    text: Text
    """The class in one line."""


class Report(Block, frozen=True, kw_only=True):
    """The report of a run: everything that is computed from its pairs."""

    schema_version: Literal[7] = REPORT_VERSION
    """Version of this document's form; it changes when a field is added, removed or given another meaning."""
    pairs: PairCounts
    """Pairs that were planned, played and lost, and which were lost."""
    selection: PlayedSelection | None
    """The part of the case set that was played; None for runs that did not record it."""
    headline: Headline
    """Rates over all planned pairs; withheld while one is missing or invalid."""
    missing_as_failures: MissingAsFailures | None = None
    """The rates that count missing and invalid pairs as failures, as the paper does; None where no pair lacks
    a result, none has one, a rule stopped the run or a shard lacks."""
    policy: dict[str, Any] | None
    """The policy's spec as played, as in its records; None where no pair was played."""
    inference: Inference
    """Protocol class: what the world does while the policy is asked."""
    substrate: Substrate
    """The substrate of the run, and the standing of its scores."""
    warnings: list[Text] = field(default_factory=list)
    """What has to be known before any number, as sentences: lacking pairs, events that did not happen, and a
    Base that has nothing to lose."""
    caveats: list[Caveat]
    """Notes on single pairs of this run whose scene, prompt or event differs from its name, or whose policy
    server was interrupted."""
    overall: Result
    """The result over all played pairs."""
    returned: Returned | None = None
    """Numbers of actions that the policy's servers returned; None where no record says."""
    clipped_actions: ClippedActions | None
    """Action components outside [-1, 1], which the controller clips; None where no pair was played."""
    changed_pairs: list[ChangedPair]
    """Played pairs of which one arm succeeded and the other failed, by item id."""
    causes: dict[str, dict[str, Count]]
    """Number of failed arms of Base and of Dynamic, by cause."""
    base_failures: list[BaseFailures] = field(default_factory=list)
    """Failures of Base by cause, the most frequent first, where Base solves less than half."""
    by: dict[str, dict[str, Result]]
    """Results by group, for nine ways of grouping: event, family, suite, source, category (source and source
    category), severity, variant (event and parameter variant), difficulty and program (no group where no case
    has one). Groups hold different cases: differences between groups are descriptions, not effects."""
    category_by_event: dict[str, dict[str, Cell]]
    """Outcomes of each source category (outer key) under each event (inner key)."""
    macro: Macros
    """Unweighted means over groups; secondary to the rates over all pairs."""
    largest_split: Split | None
    """The event whose two parameter variants differ most in Dynamic success; None where no event has two
    played variants. The variants hold different cases: a description, not an effect."""
    extremes: dict[str, Extremes]
    """By source, the source categories that stand out, the first by name among equals; sources without a
    played pair are left out."""
    success_curves: SuccessCurves | None = None
    """Pairs not yet completed by policy step; None where no pair was played."""
    study: Study | None = None
    """Results of the study of the run; None for a run of no study."""
    sections: dict[str, dict[str, Measure | str | int | float | bool | None]]
    """Tables, titles with names and values: how long it took, sections that installed packages add, and what
    hooks of the user's own have added, which is not computed from the pairs."""
    statements: dict[str, Text]
    """Limits of these numbers: sentences by a stable key."""
    methods: dict[str, str | float]
    """Methods by which the numbers are computed, a sentence each."""
    provenance: dict[str, Any]
    """Everything that could change a result, as the header of pairs.jsonl has it."""
