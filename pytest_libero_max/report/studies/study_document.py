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
    """Cases that ended alike in all arms.

    Attributes:
        success: Success of each arm.
        cases: Cases that ended so.
    """

    success: dict[str, bool]
    cases: Count


class ResetApproach(Block, frozen=True, kw_only=True):
    """All cases by the end of Reset.

    Attributes:
        failed_never_entered: Reset fails, and the hand never came within the trigger's distance.
        failed_entered: Reset fails after the hand came within the distance.
        succeeded_never_entered: Reset succeeds without coming within the distance.
        succeeded_entered: Reset succeeds after it came within the distance.
    """

    failed_never_entered: Count
    failed_entered: Count
    succeeded_never_entered: Count
    succeeded_entered: Count


class LostInReset(Block, frozen=True, kw_only=True):
    """Cases that only Reset loses.

    Attributes:
        cases: Cases that succeed in Base and Mid-task and fail in Reset.
        reset_never_entered: Those in which Reset never came within the distance.
    """

    cases: Count
    reset_never_entered: Count


class LostInMiddle(Block, frozen=True, kw_only=True):
    """Cases that only Mid-task loses.

    Attributes:
        cases: Cases that succeed in Base and Reset and fail in Mid-task.
        with_a_query_after_the_event: Those in which a query followed the event.
        without_stale_actions: Those of them in which no stale action was executed.
    """

    cases: Count
    with_a_query_after_the_event: Count
    without_stale_actions: Count


class Approach(Block, frozen=True, kw_only=True):
    """Approach of the hand in Reset, and queries after the event.

    Attributes:
        triggered: Cases in which the event fired in Mid-task.
        query_after_the_event: Cases in which a query followed it.
        reset: All cases by the end of Reset.
        base_and_middle_succeed_reset_fails: Cases that only Reset loses.
        base_and_reset_succeed_middle_fails: Cases that only Mid-task loses.
    """

    triggered: Count
    query_after_the_event: Count
    reset: ResetApproach
    base_and_middle_succeed_reset_fails: LostInReset
    base_and_reset_succeed_middle_fails: LostInMiddle


class Camera(Block, frozen=True, kw_only=True):
    """Results of a camera study.

    Attributes:
        conditions: Name of each arm in tables. Mid-task is the arm dynamic.
        rates: Success by arm.
        outcomes: Endings of cases in all arms together, the frequent ones first.
        contrasts: Within each strength, and of each timing between strengths.
        gap_contrasts: Mid-task less Reset at one strength, less the same at another.
        approach: Approach of the hand, by strength.
    """

    conditions: dict[str, str]
    rates: dict[str, ConditionRate]
    outcomes: list[JointOutcome]
    contrasts: list[ConditionContrast]
    gap_contrasts: list[ConditionContrast]
    approach: dict[str, Approach]


class SettingChange(MeanDifference, frozen=True, kw_only=True):
    """Dynamic less Base at a setting, the mean over the cases.

    Attributes:
        count: Gains minus regressions.
        bootstrap_by_source: The paper's interval, with the number of cases of each source kept.
    """

    bootstrap_by_source: Interval


class Setting(Block, frozen=True, kw_only=True):
    """One setting of a sweep. Its executed prefixes are its own.

    Attributes:
        label: The setting in one text, for people.
        own: True for the pairs that the rest of the report is about: the policy's own cadence, no delay.
        base_success: Success in Base at this setting.
        dynamic_success: Success in Dynamic at this setting.
        paired_change: Dynamic less Base, the mean over the cases.
        outcomes: The four outcomes (Base, Dynamic).
        conditional_regression: Base successes lost in Dynamic.
        trigger_coverage: Cases whose event fired.
        response_coverage: Cases with a query after the event.
        stale_actions: Stale actions of the cases with a query after the event.
    """

    label: Text
    own: bool
    base_success: Rate
    dynamic_success: Rate
    paired_change: SettingChange
    outcomes: Outcomes
    conditional_regression: Rate
    trigger_coverage: Rate
    response_coverage: Rate
    stale_actions: StaleActions


class CadenceSetting(Setting, frozen=True, kw_only=True):
    """One setting of a cadence sweep.

    Attributes:
        horizon: H (chunk size), the most actions a query returns.
        query_interval: Q (execution horizon, replan steps), the actions executed before the next query.
        returned: Actions of a whole chunk, of which the first H were taken: the policy's own H, or the
            largest number that its server returned.
    """

    horizon: Positive
    query_interval: Positive
    returned: Positive | None = None


class LatencySetting(Setting, frozen=True, kw_only=True):
    """One setting of a latency sweep.

    Attributes:
        steps: Control steps from an observation to the first action that may follow from it.
        runner: async where the robot goes on with the chunk before, sync where it waits for the answer.
        base_cost: Success in Base less that without delay, the mean over the cases.
        dynamic_cost: Success in Dynamic less that without delay, the mean over the cases.
        held: Share of the executed steps of Base and Dynamic in which the robot waited for an answer.
    """

    steps: Count
    runner: Text
    base_cost: MeanDifference
    dynamic_cost: MeanDifference
    held: Share | None


class Cadence(Block, frozen=True, kw_only=True):
    """Results of a cadence sweep.

    Attributes:
        settings: By Q and then H.
        best: Best setting for base_success and for dynamic_success; empty without cases.
    """

    settings: list[CadenceSetting]
    best: dict[str, BestSetting]


class Latencies(Block, frozen=True, kw_only=True):
    """Results of a latency sweep.

    Attributes:
        settings: No delay first, then by steps.
    """

    settings: list[LatencySetting]


class Executed(Block, frozen=True, kw_only=True):
    """Executed steps and queries; settle steps and queries asked again as a check are not counted.

    Attributes:
        arms: Arms of all cases.
        steps: Policy steps executed, shared ones once.
        steps_singly: Policy steps with every arm played by itself from the start.
        steps_as_pairs: Policy steps with a Base for every arm that has an event, as in runs of their own.
        queries: Policy queries, shared ones once.
        queries_singly: Policy queries with every arm played by itself.
        queries_as_pairs: Policy queries with a Base for every arm that has an event.
    """

    arms: Count
    steps: Count
    steps_singly: Count
    steps_as_pairs: Count
    queries: Count
    queries_singly: Count
    queries_as_pairs: Count


class ArmContrast(Block, frozen=True, kw_only=True):
    """Success in an arm less that in another, over the cases that were played in both.

    Attributes:
        first: The arm.
        second: The other one.
        event: Event of the cases; None for all of them.
        cases: Their number.
        gains: Cases that succeed in the first arm alone.
        losses: Cases that succeed in the second arm alone.
        value: Mean difference; None without a case.
        lower: Lower end of its exact 95% interval.
        upper: Upper end of the same.
    """

    first: Text
    second: Text
    event: Text | None
    cases: Count
    gains: Count
    losses: Count
    value: Difference | None
    lower: Difference | None
    upper: Difference | None


class Study(Block, frozen=True, kw_only=True):
    """Results of the study of a run.

    Attributes:
        name: Name of the study; arms where cases have further arms without one.
        title: Heading of its part of the report.
        cases: Measured cases.
        arms: Success by arm, over the cases that were played in it: programs, and studies of other packages;
            None for the camera studies and the sweeps.
        by_event: The same by event; None for an audit as well.
        contrasts: Each further arm less Base, and Dynamic less it where there is ``by_event``, of all cases
            and, likewise, of each event.
        camera: Results of a camera study; None for another one.
        cadence: Results of a cadence sweep; None for another study.
        latency: Results of a latency sweep; None for another study.
        executed: Steps and queries that were executed.
    """

    name: Text
    title: Text
    cases: Count
    arms: dict[str, Rate] | None = None
    by_event: dict[str, dict[str, Rate]] | None = None
    contrasts: list[ArmContrast] | None = None
    camera: Camera | None = None
    cadence: Cadence | None = None
    latency: Latencies | None = None
    executed: Executed
