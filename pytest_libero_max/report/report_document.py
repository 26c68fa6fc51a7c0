"""``report.json`` as one typed document: built by ``report.build``, read by every writer, gate and reader."""

from __future__ import annotations

from typing import Any, Final, Literal

from msgspec import field

from pytest_libero_max.report.blocks import (
    Block,
    Change,
    Count,
    Difference,
    MeanDifference,
    Outcomes,
    Positive,
    Rate,
    Ratio,
    Result,
    Share,
    Substrate,
    Text,
)
from pytest_libero_max.report.studies.study_document import Study

REPORT_VERSION: Final = 4


class Watched(Block, frozen=True, kw_only=True):
    """What a stopping rule knows of a quantity over all planned pairs, in place of an interval of its own.

    Attributes:
        what: The gate, or the quantity where the rule watched no gate.
        verdict: Verdict on the gate; None for a quantity.
        value: End of the quantity's range that decides the gate; None where nothing or both ends do.
        lower: Smallest value that the estimate can have over all planned pairs, as the rule sees it; None
            where the rule gives none.
        upper: Largest value.
        level: Probability that the rule errs; None where it is certain.
        not_shown: True for a gate on an end of an interval that failed, and whose other end may meet it.
        detail: What the rule knows, for people.
    """

    what: Text
    verdict: Literal["passed", "failed", "undecidable"] | None
    value: float | None
    lower: float | None
    upper: float | None
    level: Share | None
    not_shown: bool
    detail: Text

    @property
    def text(self) -> str:
        """A sentence for people."""
        return f"{self.what}: {'' if self.verdict is None else f'{self.verdict}, '}{self.detail}"


class Stop(Block, frozen=True, kw_only=True):
    """Reason a run was stopped before every planned pair was played.

    Attributes:
        reason: For people, without a period.
        of: Number of planned pairs.
        rule: The stopping rule as asked for; None where something broke, or -x stopped the run.
        at: Number of pairs, the first ones in the order of play, on which the rule decided; None without a
            rule.
        bias: The way in which the estimates of such a run are off on average; None where the rule does not
            look at outcomes, and without a rule.
        watched: What the rule knows of the gates, or of the quantity, that it watched; empty for other rules.
    """

    reason: Text
    of: Positive
    rule: str | None
    at: Count | None
    bias: str | None = None
    watched: list[Watched]


class MissingPair(Block, frozen=True, kw_only=True):
    """A planned pair with neither a record nor an error.

    Attributes:
        case_id: Id of the case in its manifest.
        item_id: Name of the test item; select it with -k.
    """

    case_id: Text
    item_id: Text


class InvalidPair(MissingPair, frozen=True, kw_only=True):
    """A pair that could not be measured.

    Attributes:
        phase: Part in which it failed: setup, base, dynamic, crash, or the name of another arm.
        kind: Type of the error.
        message: Message of the error.
    """

    phase: str
    kind: str
    message: str


class PairCounts(Block, frozen=True, kw_only=True):
    """Pairs that were planned, played and lost, and which were lost.

    Attributes:
        planned: Assigned pairs; the denominator of the headline.
        played: Pairs with a valid record.
        invalid: Pairs that could not be measured because of an error of the machinery, never of the policy.
        missing: Planned pairs with neither a record nor an error.
        complete: True if every planned pair was played, at least one was planned, and no shard lacks.
        missing_shards: Shards that the merged runs lack, for example 3/4; a run without one of its shards is
            not complete.
        invalid_pairs: The invalid pairs in the order of their case ids.
        missing_pairs: The missing pairs in the order of their case ids.
        repaired_pairs: Item ids of pairs that were measured when they were played again after an error.
        unsupported: Pairs of suites that the policy declares it does not support. They are not among the
            planned ones: neither played nor failed.
        unsupported_suites: The suites of these pairs.
        stopped: Reason the run was stopped before every planned pair was played; None where it was not.
    """

    planned: Count
    played: Count
    invalid: Count
    missing: Count
    complete: bool
    missing_shards: list[str]
    invalid_pairs: list[InvalidPair]
    missing_pairs: list[MissingPair]
    repaired_pairs: list[str]
    unsupported: Count
    unsupported_suites: list[str]
    stopped: Stop | None = None


class PresentShards(Block, frozen=True, kw_only=True):
    """Parts of a divided case set that are here.

    Attributes:
        of: Number of parts.
        present: Numbers of those that are here, from 1.
    """

    of: Positive
    present: list[Positive]


class PlayedSelection(Block, frozen=True, kw_only=True):
    """The part of the case set that was played.

    Attributes:
        asked: The user's selection, as the command line spells it.
        chosen: Number of cases that the run plays.
        of: Number of cases of the whole track or manifest.
        digest: SHA-256 of the sorted ids of the chosen cases, hexadecimal.
        shards: Shards that these are; None where the cases were not divided, or where all shards are here.
        merged: True if this is several runs joined.
        whole: True if these are all cases of the track or manifest.
        missing_shards: Shards that a merge lacks, for example 3/4.
        text: The selection in words.
    """

    asked: list[str]
    chosen: Count
    of: Count
    digest: Text
    shards: PresentShards | None
    merged: bool
    whole: bool
    missing_shards: list[str]
    text: Text


class Headline(Block, frozen=True, kw_only=True):
    """Rates over all planned pairs.

    Attributes:
        status: complete where every planned pair was played; otherwise withheld, and the rates are None.
        reason: Reason the rates are withheld; None where they are not.
        base_success: Base success rate.
        dynamic_success: Dynamic success rate.
        paired_change: Mean of Dynamic less Base success.
    """

    status: Literal["complete", "withheld"]
    reason: str | None
    base_success: Rate | None = None
    dynamic_success: Rate | None = None
    paired_change: Change | None = None


class MissingAsFailures(Block, frozen=True, kw_only=True):
    """Rates over all planned pairs, in which a pair without a result counts as a failure in both arms.

    The paper counts a missing terminal result so. It is no score of this run: a simulator, server or protocol
    fault is not the policy's, and the pair can be played again.

    Attributes:
        without_result: Planned pairs without a record, missing or invalid.
        base_success: Base success rate.
        dynamic_success: Dynamic success rate.
        paired_change: Mean of Dynamic less Base success.
    """

    without_result: Positive
    base_success: Rate
    dynamic_success: Rate
    paired_change: Ratio


class Caveat(Block, frozen=True, kw_only=True):
    """A note on pairs whose scene, prompt or event differs from its name.

    Attributes:
        name: Stable key of the caveat.
        pairs: Played pairs that it concerns.
        played: All played pairs.
        text: The note, as a sentence.
    """

    name: Text
    pairs: Positive
    played: Positive
    text: Text


class NoiseFloor(Block, frozen=True, kw_only=True):
    """Base played twice on some cases.

    Attributes:
        flips: Second Base rollouts that ended otherwise than the first.
        identical: Second Base rollouts that were the same bit for bit.
    """

    flips: Rate
    identical: Ratio


class Returned(Block, frozen=True, kw_only=True):
    """Numbers of actions that servers returned to a query, before they were cut to H.

    Attributes:
        least: The smallest.
        most: The largest.
    """

    least: Positive
    most: Positive


class Chance(Block, frozen=True, kw_only=True):
    """Base and Dynamic played twice from the event on: flips by the policy's own chance, and beyond it.

    Attributes:
        flips: Pairs of which Base and Dynamic end differently.
        base_flips: Pairs of which the two Bases end differently.
        dynamic_flips: Pairs of which the two Dynamics end differently.
        floor: Share of the pairs that flip by chance where the event does nothing more: the mean of the two.
        beyond: Mean of (Dynamic - Base) of the first rollouts times that of the second: flips less the floor,
            without bias. Its interval is exact.
    """

    flips: Rate
    base_flips: Rate
    dynamic_flips: Rate
    floor: Share
    beyond: MeanDifference


class Sham(Block, frozen=True, kw_only=True):
    """A sham event on some pairs: the policy was given other seeds at the event's moment, nothing changed.

    Attributes:
        pairs: Pairs in which it was played.
        identical: Pairs in which the rollout stayed that of Base, bit for bit.
        lost: Base successes that fail after the sham event.
        gained: Base failures that succeed after it.
        event_lost: Base successes of the same pairs that fail in Dynamic.
        beyond: Success in Dynamic less success after the sham event, over the same pairs.
        chance: Flips by chance and beyond it; None for runs that did not play Dynamic twice.
    """

    pairs: Positive
    identical: Ratio
    lost: Rate
    gained: Rate
    event_lost: Rate
    beyond: MeanDifference
    chance: Chance | None = None


class ClippedActions(Block, frozen=True, kw_only=True):
    """Action components outside [-1, 1], which the controller clips.

    Attributes:
        pairs: Pairs with an executed action that had a component outside [-1, 1].
        largest_share: Largest share of such components in a rollout, over the 7 components of every executed
            action.
    """

    pairs: Count
    largest_share: Share


class Cell(Block, frozen=True, kw_only=True):
    """A source category under an event.

    Attributes:
        planned: Planned pairs of the cell.
        outcomes: Outcomes of its played pairs.
        paired_change: Paired change over its played pairs, without an interval.
    """

    planned: Count
    outcomes: Outcomes
    paired_change: Ratio


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


class Macros(Block, frozen=True, kw_only=True):
    """Unweighted means over groups; secondary to the rates over all pairs.

    Attributes:
        category: Over source categories.
    """

    category: Macro


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


class Extremes(Block, frozen=True, kw_only=True):
    """Source categories that stand out, the first by name among equals.

    Attributes:
        lowest_base_success: The category of lowest Base success.
        largest_loss: The category of lowest paired change.
    """

    lowest_base_success: Text
    largest_loss: Text


class ChangedPair(Block, frozen=True, kw_only=True):
    """A pair of which one arm succeeded and the other failed, and the cause of that failure.

    Attributes:
        item_id: Name of the test item; select it with -k.
        event: Name of the event.
        outcome: regression, where Dynamic failed, or change_associated_success, where Base did.
        cause: Of the failed arm; see the list of causes.
        sentence: The cause with its numbers.
    """

    item_id: Text
    event: Text
    outcome: Literal["regression", "change_associated_success"]
    cause: Text
    sentence: Text

    @property
    def program(self) -> str:
        """Name of the program that the pair plays, with which its item id ends; empty where it has none."""
        return self.item_id.partition(f"-{self.event}-v")[2].partition("-")[2]


class BaseFailures(Block, frozen=True, kw_only=True):
    """Failures of Base of one cause.

    Attributes:
        cause: The cause; see the list of causes.
        pairs: Number of pairs.
        item_ids: Names of the first of them, by name.
        sentence: The cause with the numbers of the first pair.
    """

    cause: Text
    pairs: Positive
    item_ids: list[Text]
    sentence: Text


class SuccessCurves(Block, frozen=True, kw_only=True):
    """Survival curves of Base and Dynamic over the same pairs: nothing is censored before an episode's end.

    Attributes:
        pairs: Played pairs.
        steps: Policy steps at which a pair is completed; 0 and the longest episode as well.
        base: Number of pairs that Base has not completed by each of these.
        dynamic: Number of pairs that Dynamic has not completed by then.
    """

    pairs: Count
    steps: list[Count]
    base: list[Count]
    dynamic: list[Count]


class Report(Block, frozen=True, kw_only=True):
    """The report of a run: everything that is computed from its pairs.

    Attributes:
        schema_version: Version of this document's form; it changes when a field is added, removed or given
            another meaning.
        pairs: Pairs that were planned, played and lost, and which were lost.
        selection: The part of the case set that was played; None for runs that did not record it.
        headline: Rates over all planned pairs; withheld while one is missing or invalid.
        missing_as_failures: The rates that count missing and invalid pairs as failures, as the paper does;
            None where no pair lacks a result, none has one, a rule stopped the run or a shard lacks.
        policy: The policy's spec as played, as in its records; None where no pair was played.
        substrate: The substrate of the run, and the standing of its scores.
        warnings: What has to be known before any number, as sentences: lacking pairs, events that did not
            happen, and a Base that has nothing to lose.
        caveats: Notes on single pairs of this run whose scene, prompt or event differs from its name,
            or whose policy server was interrupted.
        overall: The result over all played pairs.
        noise_floor: Base played twice on some cases: how often the second ended otherwise, and how often it
            was the same bit for bit.
        sham: A sham event on some pairs, whose losses are the policy's own chance; None where none was
            played.
        returned: Numbers of actions that the policy's servers returned; None where no record says.
        clipped_actions: Action components outside [-1, 1], which the controller clips; None where no pair
            was played.
        changed_pairs: Played pairs of which one arm succeeded and the other failed, by item id.
        causes: Number of failed arms of Base and of Dynamic, by cause.
        base_failures: Failures of Base by cause, the most frequent first, where Base solves less than half.
        by: Results by group, for nine ways of grouping: event, family, suite, source, category (source and
            source category), severity, variant (event and parameter variant), difficulty and program (no
            group where no case has one). Groups hold different cases: differences between groups are
            descriptions, not effects.
        category_by_event: Outcomes of each source category (outer key) under each event (inner key).
        macro: Unweighted means over groups; secondary to the rates over all pairs.
        largest_split: The event whose two parameter variants differ most in Dynamic success; None where no
            event has two played variants. The variants hold different cases: a description, not an effect.
        extremes: By source, the source categories that stand out, the first by name among equals; sources
            without a played pair are left out.
        success_curves: Pairs not yet completed by policy step; None where no pair was played.
        study: Results of the study of the run; None for a run of no study.
        sections: Tables, titles with names and values: how long it took, means of what probes measured, by
            probe, column and arm, and what hooks of the user's own have added, which is not computed from the
            pairs.
        statements: Limits of these numbers: sentences by a stable key.
        methods: Methods by which the numbers are computed, a sentence each.
        provenance: Everything that could change a result, as the header of pairs.jsonl has it.
    """

    schema_version: Literal[4] = REPORT_VERSION
    pairs: PairCounts
    selection: PlayedSelection | None
    headline: Headline
    missing_as_failures: MissingAsFailures | None = None
    policy: dict[str, Any] | None
    substrate: Substrate
    warnings: list[Text] = field(default_factory=list)
    caveats: list[Caveat]
    overall: Result
    noise_floor: NoiseFloor | None
    sham: Sham | None = None
    returned: Returned | None = None
    clipped_actions: ClippedActions | None
    changed_pairs: list[ChangedPair]
    causes: dict[str, dict[str, Count]]
    base_failures: list[BaseFailures] = field(default_factory=list)
    by: dict[str, dict[str, Result]]
    category_by_event: dict[str, dict[str, Cell]]
    macro: Macros
    largest_split: Split | None
    extremes: dict[str, Extremes]
    success_curves: SuccessCurves | None = None
    study: Study | None = None
    sections: dict[str, dict[str, str | int | float | bool | None]]
    statements: dict[str, Text]
    methods: dict[str, str | float]
    provenance: dict[str, Any]
