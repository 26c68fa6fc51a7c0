"""The part of ``report.json`` that is about a study, declared once for writers, readers and the schema."""

from __future__ import annotations

from typing import Any

from pytest_libero_max.stats.blocks import (
    BestSetting,
    Block,
    Count,
    Difference,
    MeanDifference,
    Positive,
    Rate,
    Result,
    Share,
    Text,
)


class Setting(Result, frozen=True, kw_only=True):
    """A Base and a Dynamic at one cadence and latency, by one policy, with everything that a pair has."""

    label: Text
    """The setting in one text, for people."""
    own: bool
    """True for the pairs that the rest of the report is about."""
    horizon: Positive
    """H (chunk size), the most actions a query returns."""
    query_interval: Positive
    """Q (execution horizon, replan steps), the actions executed before the next query."""
    returned: Positive
    """Actions of a whole chunk, of which the first H were taken: the policy's own H, or the largest number
    that its server returned."""
    steps: Count
    """Control steps from an observation to the first action that may follow from it; the most where they are
    drawn."""
    runner: Text
    """async where the robot goes on with the chunk before, sync where it waits for the answer."""
    policy: Text | None
    """Name of the policy that goes on from the event; None for that of Base."""
    base_cost: MeanDifference | None
    """Success in Base less that of the run's own, the mean over the cases; None where it is the run's own."""
    dynamic_cost: MeanDifference | None
    """Success in Dynamic less that of the run's own, the mean over the cases; None where it is the run's
    own."""
    held: Share | None
    """Share of the executed steps of Base and Dynamic in which the robot waited for an answer."""


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
    """Results of the study of a run, or of the further arms of its programs."""

    name: Text
    """Name of the study; arms where cases have further arms without one."""
    title: Text
    """Heading of its part of the report."""
    about: str = ""
    """What is played, in the words of its program."""
    cases: Count
    """Measured cases."""
    settings: list[Setting] = []  # noqa: RUF012  # msgspec copies it
    """Pairs of arms that differ from Base and Dynamic in cadence, latency or policy alone, and these."""
    best: dict[str, BestSetting] = {}  # noqa: RUF012
    """Best setting for base_success and for dynamic_success; empty without further settings."""
    ways: dict[str, str] = {}  # noqa: RUF012
    """Policy, H and Q, and latency of the arms that have their own, in words; without those in settings."""
    arms: dict[str, Rate] | None = None
    """Success by arm, over the cases that were played in it; None where all arms are in settings, and for a
    camera study."""
    by_event: dict[str, dict[str, Rate]] | None = None
    """The same by event; None as well where a section of the report compares the arms."""
    contrasts: list[ArmContrast] | None = None
    """Each further arm less Base, and Dynamic less it where there is ``by_event``, of all cases and,
    likewise, of each event."""
    camera: Any = None
    """Results of a camera study, in the form of its section: rates, contrasts and approach; None for
    another one."""
    executed: Executed
    """Steps and queries that were executed."""
