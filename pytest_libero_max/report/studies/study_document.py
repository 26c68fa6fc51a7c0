"""The part of ``report.json`` that is about a study, declared once for writers, readers and the schema."""

from __future__ import annotations

from pytest_libero_max.stats.blocks import (
    Block,
    Count,
    Difference,
    Interval,
    MeanDifference,
    Outcomes,
    Positive,
    Rate,
    Share,
    StaleActions,
    Text,
)
from pytest_libero_max.stats.condition_blocks import BestSetting, ConditionContrast, ConditionRate


class JointOutcome(Block, frozen=True, kw_only=True):
    """Cases that ended alike in all arms."""

    success: dict[str, bool]
    """Success of each arm."""
    cases: Count
    """Cases that ended so."""


class ResetApproach(Block, frozen=True, kw_only=True):
    """All cases by the end of Reset."""

    failed_never_entered: Count
    """Reset fails, and the hand never came within the trigger's distance."""
    failed_entered: Count
    """Reset fails after the hand came within the distance."""
    succeeded_never_entered: Count
    """Reset succeeds without coming within the distance."""
    succeeded_entered: Count
    """Reset succeeds after it came within the distance."""


class LostInReset(Block, frozen=True, kw_only=True):
    """Cases that only Reset loses."""

    cases: Count
    """Cases that succeed in Base and Mid-task and fail in Reset."""
    reset_never_entered: Count
    """Those in which Reset never came within the distance."""


class LostInMiddle(Block, frozen=True, kw_only=True):
    """Cases that only Mid-task loses."""

    cases: Count
    """Cases that succeed in Base and Reset and fail in Mid-task."""
    with_a_query_after_the_event: Count
    """Those in which a query followed the event."""
    without_stale_actions: Count
    """Those of them in which no stale action was executed."""


class Approach(Block, frozen=True, kw_only=True):
    """Approach of the hand in Reset, and queries after the event."""

    triggered: Count
    """Cases in which the event fired in Mid-task."""
    query_after_the_event: Count
    """Cases in which a query followed it."""
    reset: ResetApproach
    """All cases by the end of Reset."""
    base_and_middle_succeed_reset_fails: LostInReset
    """Cases that only Reset loses."""
    base_and_reset_succeed_middle_fails: LostInMiddle
    """Cases that only Mid-task loses."""


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
    approach: dict[str, Approach]
    """Approach of the hand, by strength."""


class SettingChange(MeanDifference, frozen=True, kw_only=True):
    """Dynamic less Base at a setting, the mean over the cases.

    Attributes:
        count: Gains minus regressions.
        bootstrap_by_source: The paper's interval, with the number of cases of each source kept.
    """

    bootstrap_by_source: Interval


class Setting(Block, frozen=True, kw_only=True):
    """One setting of a sweep. Its executed prefixes are its own."""

    label: Text
    """The setting in one text, for people."""
    own: bool
    """True for the pairs that the rest of the report is about: the policy's own cadence, no delay."""
    base_success: Rate
    """Success in Base at this setting."""
    dynamic_success: Rate
    """Success in Dynamic at this setting."""
    paired_change: SettingChange
    """Dynamic less Base, the mean over the cases."""
    outcomes: Outcomes
    """The four outcomes (Base, Dynamic)."""
    conditional_regression: Rate
    """Base successes lost in Dynamic."""
    trigger_coverage: Rate
    """Cases whose event fired."""
    response_coverage: Rate
    """Cases with a query after the event."""
    stale_actions: StaleActions
    """Stale actions of the cases with a query after the event."""


class CadenceSetting(Setting, frozen=True, kw_only=True):
    """One setting of a cadence sweep."""

    horizon: Positive
    """H (chunk size), the most actions a query returns."""
    query_interval: Positive
    """Q (execution horizon, replan steps), the actions executed before the next query."""
    returned: Positive | None = None
    """Actions of a whole chunk, of which the first H were taken: the policy's own H, or the largest number
    that its server returned."""


class LatencySetting(Setting, frozen=True, kw_only=True):
    """One setting of a latency sweep."""

    steps: Count
    """Control steps from an observation to the first action that may follow from it."""
    runner: Text
    """async where the robot goes on with the chunk before, sync where it waits for the answer."""
    base_cost: MeanDifference
    """Success in Base less that without delay, the mean over the cases."""
    dynamic_cost: MeanDifference
    """Success in Dynamic less that without delay, the mean over the cases."""
    held: Share | None
    """Share of the executed steps of Base and Dynamic in which the robot waited for an answer."""


class Cadence(Block, frozen=True, kw_only=True):
    """Results of a cadence sweep."""

    settings: list[CadenceSetting]
    """By Q and then H."""
    best: dict[str, BestSetting]
    """Best setting for base_success and for dynamic_success; empty without cases."""


class Latencies(Block, frozen=True, kw_only=True):
    """Results of a latency sweep."""

    settings: list[LatencySetting]
    """No delay first, then by steps."""


class Executed(Block, frozen=True, kw_only=True):
    """Executed steps and queries; settle steps and queries asked again as a check are not counted."""

    arms: Count
    """Arms of all cases."""
    steps: Count
    """Policy steps executed, shared ones once."""
    steps_singly: Count
    """Policy steps with every arm played by itself from the start."""
    steps_as_pairs: Count
    """Policy steps with a Base for every arm that has an event, as in runs of their own."""
    queries: Count
    """Policy queries, shared ones once."""
    queries_singly: Count
    """Policy queries with every arm played by itself."""
    queries_as_pairs: Count
    """Policy queries with a Base for every arm that has an event."""


class ArmContrast(Block, frozen=True, kw_only=True):
    """Success in an arm less that in another, over the cases that were played in both."""

    first: Text
    """The arm."""
    second: Text
    """The other one."""
    event: Text | None
    """Event of the cases; None for all of them."""
    cases: Count
    """Their number."""
    gains: Count
    """Cases that succeed in the first arm alone."""
    losses: Count
    """Cases that succeed in the second arm alone."""
    value: Difference | None
    """Mean difference; None without a case."""
    lower: Difference | None
    """Lower end of its exact 95% interval."""
    upper: Difference | None
    """Upper end of the same."""


class Study(Block, frozen=True, kw_only=True):
    """Results of the study of a run."""

    name: Text
    """Name of the study; arms where cases have further arms without one."""
    title: Text
    """Heading of its part of the report."""
    cases: Count
    """Measured cases."""
    arms: dict[str, Rate] | None = None
    """Success by arm, over the cases that were played in it: programs, and studies of other packages; None
    for the camera studies and the sweeps."""
    by_event: dict[str, dict[str, Rate]] | None = None
    """The same by event; None as well where a section of the report compares the arms."""
    contrasts: list[ArmContrast] | None = None
    """Each further arm less Base, and Dynamic less it where there is ``by_event``, of all cases and,
    likewise, of each event."""
    camera: Camera | None = None
    """Results of a camera study; None for another one."""
    cadence: Cadence | None = None
    """Results of a cadence sweep; None for another study."""
    latency: Latencies | None = None
    """Results of a latency sweep; None for another study."""
    executed: Executed
    """Steps and queries that were executed."""
